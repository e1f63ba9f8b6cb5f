# SPDX-License-Identifier: GPL-3.0-or-later
"""Styles and wraps below deformations: every kind of result, bakes, copies, armatures."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes, wraps
    from support.blender.layers import QUICK, SAME, STYLE, structure, styled, with_handles
    from support.blender.live import step
    from support.blender.pins import pin

    from addon.core.runtime import jobs
    from addon.field_modifier import layers, motion
    from addon.live import sessions

pytestmark = pytest.mark.in_blender


@pytest.mark.parametrize("result", ["NEW", "REPLACE", "KEY"])
def test_every_kind_of_result_is_that_of_the_modifier(result):
    bar, shape, rest = styled()
    with_handles(bar).location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**QUICK)
    moved = scenes.world_points(bar)
    bpy.ops.arapfields.remove_field()
    assert bpy.ops.arapfields.deform(result=result, **QUICK) == {"FINISHED"}
    found = bpy.data.objects["Bar_deformed"] if result == "NEW" else bar
    assert np.abs(scenes.world_points(found) - moved).max() < SAME
    kept = {"NEW": shape, "REPLACE": moved, "KEY": moved}[result]
    assert np.abs(scenes.world_points(bar) - kept).max() < SAME
    assert len(bar.modifiers) == (0 if result == "REPLACE" else 1)
    if result == "KEY":
        bar.data.shape_keys.key_blocks["ARAP Fields"].value = 0.0
        assert np.abs(scenes.world_points(bar) - shape).max() < SAME
    assert bar.arapfields.moved_by == ("" if result == "REPLACE" else "STYLIZE")
    assert len(rest) == len(shape)


def test_a_style_with_handles_or_riders_is_replaced_and_that_is_said():
    bar, _, _ = styled()
    hat = scenes.cube_empty((0, 0, 0.5), (0.1, 0.1, 0.1), "Hat")
    scenes.activate(hat, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    scenes.activate(bar)
    bpy.ops.arapfields.stylize(**STYLE)
    with_handles(bar).location.z += 0.4
    bpy.context.view_layer.update()
    jobs.forget_messages()
    assert bpy.ops.arapfields.deform(**QUICK) == {"FINISHED"}
    assert "Bar: this replaces the result of Stylize" in str(jobs.messages()) and len(bar.modifiers) == 1
    bpy.ops.arapfields.release()
    bar.arapfields.stylize.use_handles = True
    bpy.ops.arapfields.stylize(**STYLE)
    assert bar.arapfields.moved_by == layers.POSED
    posed = scenes.world_points(bar)
    pin(bar, posed[0])
    assert sessions.is_live(bar, "STYLIZE") and np.array_equal(scenes.world_points(bar), posed)


def test_a_bake_plays_over_the_style(tmp_path):
    bar, shape, _ = styled()
    moving = with_handles(bar)
    moving.keyframe_insert("location", frame=1)
    moving.location.z += 0.4
    moving.keyframe_insert("location", frame=4)
    bpy.context.scene.frame_set(1)
    assert bpy.ops.arapfields.bake(filepath=str(tmp_path / "a.pc2"), start=1, end=4) == {"FINISHED"}
    assert [m.type for m in bar.modifiers] == ["NODES", "MESH_CACHE"]
    bpy.context.scene.frame_set(1)
    assert np.abs(scenes.world_points(bar) - shape).max() < 1e-5
    bpy.context.scene.frame_set(4)
    baked = scenes.world_points(bar)
    bpy.ops.arapfields.live()
    step(refined=True)
    assert np.abs(scenes.world_points(bar) - baked).max() < 0.02 and np.abs(baked - shape).max() > 0.2
    bpy.ops.arapfields.live()
    assert bpy.ops.arapfields.remove_bake() == {"FINISHED"}
    assert np.array_equal(scenes.world_points(bar), shape)


def test_a_copy_keeps_its_layers():
    bar, shape, _ = styled()
    with_handles(bar).location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**QUICK)
    moved = scenes.world_points(bar)
    for linked in (False, True):
        scenes.activate(bar)
        bpy.ops.object.duplicate(linked=linked)
        copied = bpy.context.object
        assert np.array_equal(scenes.world_points(copied), moved)
        assert bpy.ops.arapfields.remove_field() == {"FINISHED"}
        assert np.array_equal(scenes.world_points(copied), shape)
        assert np.array_equal(scenes.world_points(bar), moved)
    assert motion.snapshot(bar).offsets is not None


def test_bones_that_a_wrap_has_fitted_pose_the_wrapped_shape():
    """As handles, too; and what the wrap has made stays when these go."""
    item, rig = wraps.rigged_bar()
    item.arapfields.wrap.onto = wraps.soup_of(item)
    assert bpy.ops.arapfields.wrap(**wraps.SMALL) == {"FINISHED"}
    wrapped, before = scenes.world_points(item), structure(item)
    bones = wraps.joints(rig, posed=False)
    assert before[3]
    scenes.activate(rig, item)
    assert bpy.ops.arapfields.add_bones() == {"FINISHED"}
    scenes.activate(item)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    step(refined=True)
    size = np.ptp(wrapped, axis=0).max()
    assert np.abs(scenes.world_points(item) - wrapped).max() < 1e-4 * size
    rig.pose.bones["Upper"].rotation_mode = "XYZ"
    rig.pose.bones["Upper"].rotation_euler.x = 0.4
    step(refined=True)
    assert np.abs(scenes.world_points(item) - wrapped).max() > 0.05 * size
    bpy.ops.arapfields.live()
    rig.pose.bones["Upper"].rotation_euler.x = 0.0
    bpy.context.view_layer.update()
    assert structure(item) == before and np.array_equal(scenes.world_points(item), wrapped)
    assert bpy.ops.arapfields.stylize(**STYLE) == {"FINISHED"}
    assert [m.type for m in item.modifiers] == ["NODES", "ARMATURE", "NODES"]
    assert np.array_equal(wraps.joints(rig, posed=False), bones)
    while len(item.arapfields.handles):
        bpy.ops.arapfields.remove_handle()
    for left in (2, 1):
        assert bpy.ops.arapfields.remove_field() == {"FINISHED"} and len(item.modifiers) == left
    assert not np.allclose(wraps.joints(rig, posed=False), bones)
