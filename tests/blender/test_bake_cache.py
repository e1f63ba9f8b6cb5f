# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes as point caches: what plays them, where they lie, and what is left when something goes wrong."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import EXACT, at, saved_animation, solved
    from support.blender.live import step
    from support.blender.panels import drawn
    from support.blender.stacks import add_modifier, local_points

    import addon.animation.bake_job as bake_job
    from addon.core.runtime import jobs
    from addon.field_modifier import cache_modifier
    from addon.live import sessions

pytestmark = pytest.mark.in_blender


def test_a_cache_plays_what_the_solver_says_at_every_frame():
    bar, folder = saved_animation()
    bpy.context.scene.frame_set(3)
    assert bpy.ops.arapfields.bake(start=1, end=5, subframes=2) == {"FINISHED"}
    assert bpy.context.scene.frame_current == 3
    path = folder / "cache/scene~Scene~Bar.pc2"
    assert path.stat().st_size == 32 + 9 * 12 * len(bar.data.vertices)
    (modifier,) = bar.modifiers
    assert modifier.type == "MESH_CACHE" and modifier.filepath == "//cache/scene~Scene~Bar.pc2"
    shown = drawn()["ARAPFIELDS_PT_animation"]
    assert "ARAP Fields Cache" in shown and "250 samples, 1.2 MB" in shown, shown
    for frame in (1, 2.5, 4, 5):
        assert np.abs(at(bar, frame) - solved(bar, frame)).max() <= EXACT, frame
    assert np.abs(at(bar, 9) - at(bar, 5)).max() == 0


def test_the_cache_stands_where_the_field_does_and_a_second_bake_keeps_its_modifier():
    bar, folder = saved_animation()
    bar.modifiers.new("Subdivision", "SUBSURF").levels = 1
    bpy.ops.arapfields.deform(**scenes.QUICK)
    assert [m.type for m in bar.modifiers] == ["NODES", "SUBSURF"]
    bpy.ops.arapfields.bake(start=1, end=3)
    field, cache, _ = bar.modifiers
    assert cache.type == "MESH_CACHE" and not field.show_viewport and not field.show_render
    cache.factor, cache.name = 0.5, "Renamed"
    bpy.ops.arapfields.bake(start=2, end=6, step=2, format="MDD", filepath="//other.mdd")
    assert [m.type for m in bar.modifiers] == ["NODES", "MESH_CACHE", "SUBSURF"]
    cache = bar.modifiers["Renamed"]
    assert cache.factor == 0.5 and cache.filepath == "//other.mdd" and cache.cache_format == "MDD"
    assert (folder / "other.mdd").stat().st_size == 8 + 3 * 4 + 3 * 12 * len(bar.data.vertices)
    cache.factor, bar.modifiers["Subdivision"].show_viewport = 1.0, False
    for frame in (2, 6):
        assert np.abs(at(bar, frame) - solved(bar, frame)).max() <= EXACT, frame
    assert bpy.ops.arapfields.remove_bake() == {"FINISHED"}
    assert [m.type for m in bar.modifiers] == ["NODES", "SUBSURF"] and field.show_viewport


def test_several_objects_are_baked_in_one_pass_and_one_that_fails_stops_no_other():
    first, folder = saved_animation("One")
    second, _ = saved_animation("Two", folder)
    plain = scenes.bar("Plain")
    plain.location.y = 3
    scenes.activate(plain, second, first)
    assert bpy.ops.arapfields.bake(start=1, end=3, scope="SELECTED") == {"FINISHED"}
    assert sorted(path.name for path in (folder / "cache").iterdir()) == [
        "scene~Scene~One.pc2",
        "scene~Scene~Two.pc2",
    ]
    assert ("WARNING", "Plain: Drag a pin or add a handle first") in jobs.messages(), jobs.messages()
    for bar in (first, second):
        assert np.abs(at(bar, 3) - solved(bar, 3)).max() <= EXACT


def test_what_moves_before_the_field_is_read_at_every_frame():
    bar, _ = saved_animation()
    add_modifier(bar, "ARMATURE")
    bone = bar.modifiers[0].object.pose.bones["Second"]
    for frame, turn in ((1, 0.0), (5, 0.5)):
        bone.rotation_euler.z = turn
        bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(1)
    ahead, bake_job.AHEAD = bake_job.AHEAD, 1
    try:
        assert bpy.ops.arapfields.bake(start=1, end=5) == {"FINISHED"}
    finally:
        bake_job.AHEAD = ahead
    shown = {frame: at(bar, frame) for frame in (2, 5)}
    for frame, points in shown.items():
        bpy.context.scene.frame_set(1)
        assert np.abs(points - solved(bar, frame)).max() <= EXACT
    assert np.abs(shown[5] - shown[2]).max() > 0.2


def test_outputs_that_are_no_modifier_play_on_an_object_of_their_own():
    bar, folder = saved_animation()
    bar.arapfields.output, bar.arapfields.resolution = "SURFACE", 24
    for _ in range(2):
        assert bpy.ops.arapfields.bake(start=1, end=5, step=4) == {"FINISHED"}
        bpy.context.view_layer.objects.active = bar
    item = bpy.data.objects["Bar_baked"]
    assert [m.type for m in item.modifiers] == ["MESH_CACHE"] and bar.hide_render and not bar.modifiers
    assert (folder / "cache/scene~Scene~Bar.pc2").stat().st_size == 32 + 2 * 12 * len(item.data.vertices)
    rise = at(item, 5) - at(item, 1)
    right = at(item, 1)[:, 0] > 0.9
    assert np.abs(rise[right][:, 2] - 0.4).max() < 0.1 and np.abs(rise[at(item, 1)[:, 0] < -0.9]).max() < 0.1


def test_live_and_deform_put_the_field_back_and_a_bake_ends_live():
    bar, _ = saved_animation()
    bpy.ops.arapfields.bake(start=1, end=5)
    baked = at(bar, 4)
    bpy.ops.arapfields.live()
    assert not cache_modifier.is_playing(bar)
    step(refined=True)
    assert np.abs(at(bar, 4) - baked).max() < 1e-4
    bpy.ops.arapfields.live()
    assert cache_modifier.is_playing(bar) and np.array_equal(at(bar, 4), baked)
    bpy.ops.arapfields.live()
    assert bpy.ops.arapfields.bake(start=1, end=5) == {"FINISHED"}
    assert not sessions.is_live(bar) and cache_modifier.is_playing(bar)
    bpy.ops.arapfields.deform(**scenes.QUICK)
    assert not cache_modifier.is_playing(bar) and bar.modifiers["ARAP Fields"].show_viewport


@pytest.mark.parametrize("kind", ["ARMATURE", "keys"])
def test_a_bake_and_live_do_not_depend_on_the_frame_at_which_they_begin(kind):
    """Where the shape before the field is animated, the one at rest is that on which handles were placed."""
    bar, scene = saved_animation()[0], bpy.context.scene
    add_modifier(bar, kind)
    bone = bar.modifiers["Armature"].object.pose.bones["Second"] if kind == "ARMATURE" else None
    moved, path = (bone, "rotation_euler") if bone else (bar.data.shape_keys.key_blocks["Wide"], "value")
    for frame, value in ((1, 0.0), (5, 1.0)):
        setattr(moved, path, (0.0, 0.0, value) if bone else value)
        moved.keyframe_insert(path, frame=frame)
    baked = []
    for pressed in (1, 4):
        scene.frame_set(pressed)
        assert bpy.ops.arapfields.bake(format="PC2", start=1, end=5) == {"FINISHED"}
        baked.append([at(bar, frame) for frame in (1, 3, 5)])
    assert np.array_equal(*baked)
    scene.frame_set(4)
    sessions.begin(bpy.context, bar)
    for frame, points in zip((1, 3, 5), baked[0], strict=True):
        scene.frame_set(frame)
        step(refined=True)
        assert np.abs(local_points(bar) - points).max() < EXACT


def test_live_begun_at_another_frame_leaves_unkeyed_poses_alone():
    bar, scene = saved_animation()[0], bpy.context.scene
    add_modifier(bar, "ARMATURE")
    bone = bar.modifiers["Armature"].object.pose.bones["Second"]
    bone.keyframe_insert("rotation_euler", frame=1)
    scene.frame_set(4)
    bone.rotation_euler.z = 1.1
    bpy.context.view_layer.update()
    sessions.begin(bpy.context, bar)
    step()
    assert abs(bone.rotation_euler.z - 1.1) < 1e-6 and scene.frame_current == 4
    assert len(bpy.data.scenes) == 1 and local_points(bar)[:, 1].max() > 0.6
