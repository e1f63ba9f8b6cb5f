# SPDX-License-Identifier: GPL-3.0-or-later
"""Carried objects in bakes, renders, and through undo."""

import tempfile

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.riders import body, rider, shown
    from support.blender.scenes import camera

    from addon.blender.actions import curves_of
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

CLOSE = 1e-5  # single precision of positions of size one


@pytest.mark.parametrize("format", ["PC2", "KEYS"])
def test_all_are_baked_at_once(format):
    bar, moving = body()
    items = [rider(kind) for kind in ("MESH", "CURVE", "EMPTY", "ARMATURE", "CURVES", "GREASEPENCIL")]
    bpy.context.view_layer.update()
    rest = [shown(item) for item in items]
    scenes.activate(*items, bar)
    bpy.ops.arapfields.carry()
    for frame, height in ((1, 0.0), (3, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    for curve in curves_of(moving.animation_data.action):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    scenes.activate(bar)
    folder = tempfile.mkdtemp()
    assert bpy.ops.arapfields.bake(format=format, start=1, end=3, folder=folder) == {"FINISHED"}
    patch = items[0] if format == "PC2" else bpy.data.objects["Patch_baked"]
    for frame in (3, 1, 2):
        bpy.context.scene.frame_set(frame)
        for item, before in zip([patch, *items[1:]], rest, strict=True):
            shift = shown(item) - before
            assert np.abs(shift - [0, 0, 0.2 * (frame - 1)]).max() < 0.08, (item.name, frame)
    if format == "PC2":
        scenes.activate(bar)
        assert bpy.ops.arapfields.remove_bake() == {"FINISHED"}
        kinds = [modifier.name for item in (bar, items[0], *items[4:]) for modifier in item.modifiers]
        assert not any("Cache" in name for name in kinds), kinds
    assert bpy.ops.arapfields.live() == {"FINISHED"}  # shown in place of the bake
    moving.location.z = 0.3
    step(refined=True)
    assert all(
        np.abs(shown(item) - before - [0, 0, 0.3]).max() < 0.1
        for item, before in zip(items[4:], rest[4:], strict=True)
    )
    bpy.ops.arapfields.live()
    bpy.ops.arapfields.release(all=True)
    for item, before in zip(items[4:], rest[4:], strict=True):
        assert np.abs(shown(item) - before).max() < CLOSE and not item.modifiers
    assert not any(data.name.endswith("_played") for data in (*bpy.data.objects, *bpy.data.meshes))


@pytest.mark.parametrize("mode", ["XYZ", "QUATERNION"])
def test_what_turns_round_is_keyed_without_a_turn_back(mode):
    """Between frames, as motion blur sees them, it is between where it is at the frames."""
    bar, moving = body()
    spot, tail = rider("EMPTY"), rider("ARMATURE")
    spot.rotation_mode = tail.pose.bones[0].rotation_mode = mode
    scenes.activate(spot, tail, bar)
    bpy.ops.arapfields.carry()
    for frame in range(1, 8):
        for handle in (moving, bpy.data.objects["Fixed"]):
            handle.rotation_euler.x = 1.0 * (frame - 1)
            handle.keyframe_insert("rotation_euler", frame=frame)
    scenes.activate(bar)
    bpy.ops.arapfields.bake(start=1, end=7, folder=tempfile.mkdtemp())

    def at(item, frame):
        bpy.context.scene.frame_set(int(frame), subframe=frame % 1)
        return shown(item)

    for item in (spot, tail):
        for frame in range(1, 7):
            ends, middle = [at(item, frame), at(item, frame + 1)], at(item, frame + 0.5)
            step = np.abs(ends[1] - ends[0]).max()
            assert all(np.abs(middle - end).max() < 0.9 * step for end in ends), (item.name, frame)


@pytest.mark.parametrize("how", ["remove_bake", "release"])
def test_keys_of_a_bake_go_with_it_and_the_users_own_stay(how):
    bar, moving = body()
    spot, cord, own = rider("EMPTY"), rider("CURVE"), rider("EMPTY")
    own.keyframe_insert("delta_location", frame=1)
    for frame, height in ((1, 0.0), (6, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(spot, cord, own, bar)
    bpy.ops.arapfields.carry()
    bpy.context.scene.frame_set(1)
    rest = [shown(item) for item in (spot, cord)]
    scenes.activate(bar)
    folder = tempfile.mkdtemp()
    for start, end in ((1, 6), (3, 4)):
        assert bpy.ops.arapfields.bake(start=start, end=end, folder=folder) == {"FINISHED"}
        for action in (spot.animation_data.action, cord.data.shape_keys.animation_data.action):
            frames = {point.co.x for curve in curves_of(action) for point in curve.keyframe_points}
            assert frames == set(range(start, end + 1)), frames
    assert getattr(bpy.ops.arapfields, how)(**({"all": True} if how == "release" else {})) == {"FINISHED"}
    for frame in (1, 4):
        bpy.context.scene.frame_set(frame)
        for item, before in zip((spot, cord), rest, strict=True):
            assert np.abs(shown(item) - before).max() < CLOSE
    left = {curve.data_path for curve in curves_of(own.animation_data.action)}
    assert "delta_location" in left and spot.animation_data.action is None


def test_undo_and_redo_take_all_along():
    bpy.context.preferences.edit.use_global_undo = True
    bar, moving = body()
    names = [rider(kind).name for kind in ("MESH", "CURVES", "CURVE", "EMPTY", "ARMATURE")]
    bpy.context.view_layer.update()
    scenes.activate(*(bpy.data.objects[name] for name in names), bar)
    bpy.ops.arapfields.carry()
    moving.location.z += 0.4
    scenes.activate(bar)

    def places():
        return [shown(bpy.data.objects[name]) for name in names]

    bpy.ops.ed.undo_push(message="before")
    before = places()
    assert bpy.ops.arapfields.deform(field="radial", samples=1000) == {"FINISHED"}
    bpy.ops.ed.undo_push(message="after")
    after = places()
    assert all(np.abs(one - other).max() > 0.2 for one, other in zip(before, after, strict=True))
    for step, expected in ((bpy.ops.ed.undo, before), (bpy.ops.ed.redo, after), (bpy.ops.ed.undo, before)):
        step()
        found = places()
        assert max(np.abs(one - other).max() for one, other in zip(found, expected, strict=True)) < CLOSE
    bar = bpy.data.objects["Bar"]
    scenes.activate(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    bpy.ops.arapfields.live()
    found = places()
    assert max(np.abs(one - other).max() for one, other in zip(found, before, strict=True)) < CLOSE


def test_renders_show_all_at_the_frame_that_is_rendered():
    scene = camera(16)
    bar, moving = body()
    items = [rider(kind) for kind in ("MESH", "EMPTY", "CURVES")]
    bpy.context.view_layer.update()
    rest = [shown(item) for item in items]
    scenes.activate(*items, bar)
    bpy.ops.arapfields.carry()
    for frame, height in ((1, 0.0), (3, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    scene.frame_start, scene.frame_end = 3, 3
    scene.render.filepath = f"{tempfile.mkdtemp()}/"
    bpy.ops.render.render(animation=True)
    for item, before in zip(items, rest, strict=True):
        assert np.abs(shown(item) - before - [0, 0, 0.4]).max() < 0.1, item.name


@pytest.mark.parametrize("kind", ["EMPTY", "ARMATURE"])
def test_files_of_versions_without_a_kind_of_base_come_back(kind):
    bar, moving = body()
    item = rider(kind)
    rest = shown(item)
    scenes.activate(item, bar)
    bpy.ops.arapfields.carry()
    moving.location.z += 0.4
    assert bpy.ops.arapfields.deform(samples=1000) == {"FINISHED"}
    assert np.abs(shown(item) - rest).max() > 0.2
    entry = bar.arapfields.carried[0]
    assert entry.base and entry.base_kind == {"EMPTY": "TRANSFORM", "ARMATURE": "BONES"}[kind]
    entry.property_unset("base_kind")
    path = f"{tempfile.mkdtemp()}/earlier.blend"
    names = bar.name, item.name
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    bar, item = (bpy.data.objects[name] for name in names)
    scenes.activate(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"}  # goes on from the object's own pose
    bpy.ops.arapfields.live()
    assert bpy.ops.arapfields.release(all=True) == {"FINISHED"}
    assert np.abs(shown(item) - rest).max() < CLOSE


def test_another_way_to_be_carried_spoils_nothing_of_the_others():
    """An armature that follows, then moves as a whole; an Empty and a patch come after it in the list."""
    bar, moving = body()
    items = [rider(kind) for kind in ("ARMATURE", "EMPTY", "MESH")]
    rest = [shown(item) for item in items]
    for item in items:
        scenes.activate(item, bar)
        bpy.ops.arapfields.carry()
    scenes.activate(bar)
    moving.location.z += 0.4
    solves = {
        "deform": lambda: bpy.ops.arapfields.deform(samples=1000),
        "live": lambda: sessions.begin(bpy.context, bar),
    }
    for name, solve in solves.items():
        for way in ("FOLLOW", "RIGID"):
            bar.arapfields.carried[0].way = way
            solve()
            step(refined=True)
            pose = np.array(items[0].pose.bones[0].matrix_basis)
            assert (np.abs(pose - np.eye(4)).max() < CLOSE) == (way == "RIGID"), (name, way)
            for item, before in zip(items, rest, strict=True):
                assert np.abs(shown(item) - before).max() > 0.2, (name, way, item.name)
        if name == "deform":
            assert bpy.ops.arapfields.remove_field() == {"FINISHED"}
    sessions.end(bpy.context, bar)
    for item, before in zip(items, rest, strict=True):
        assert np.abs(shown(item) - before).max() < CLOSE, item.name
