# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode among other modifiers: what moves before the field, and modes in which it pauses."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.stacks import add_modifier, local_points

    from addon.blender import mesh_arrays, modifier_stack
    from addon.field_modifier import inputs, motion
    from addon.live import recovery, sessions

pytestmark = pytest.mark.in_blender

BY_HAND = 1e-5  # single precision of positions of size one
KEYS_OFF = 0.02  # of a bar of two: what is shown is sampled anew, and handles rest at the frame at hand


def test_the_field_turns_what_the_modifiers_before_have_moved():
    """The armature before it moves while live: the field stays, and each point turns about its rest."""
    bar, _, moving = scenes.bar_with_handles()
    add_modifier(bar, "ARMATURE")
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    moving.location.z += 0.3
    step(refined=True)
    session = sessions.live[bar.session_uid]
    bone = bar.modifiers["Armature"].object.pose.bones["Second"]
    for angle in (0.3, 0.8):
        bone.rotation_euler.z = angle
        step(refined=True)
        with modifier_stack.evaluated_mesh(bpy.context, bar, in_place=True) as mesh:
            points = mesh_arrays.positions(mesh)
        surface, field = session.reader.surface, session.solver.field
        left, _, right = np.linalg.svd(field.jacobian(surface.vertices))
        offsets = surface.space.to_solve(points) - surface.vertices
        assert not np.median(offsets, axis=0).any() and np.linalg.det(left @ right).min() > 0
        after = field(surface.vertices) + np.einsum("nij,nj->ni", left @ right, offsets)
        expected = surface.space.to_local(after)
        assert np.abs(local_points(bar) - expected).max() < BY_HAND
        assert np.abs(expected - points).max() > 0.2
    assert sessions.live[bar.session_uid] is session and len(bpy.data.scenes) == 1
    reads = []
    session.reader.read_points = lambda *given: reads.append(given)
    for _ in range(5):
        step()
    assert not reads  # what live mode does itself moves nothing before it


@pytest.mark.parametrize("mode", ["EDIT", "SCULPT"])
def test_live_pauses_in_modes_that_change_the_mesh(mode):
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    moving.location.z += 0.2
    step()
    held = motion.snapshot(bar).offsets
    scenes.activate(bar)
    bpy.ops.object.mode_set(mode=mode)
    moving.location.z += 0.2
    step()
    if mode == "SCULPT":
        assert np.array_equal(motion.snapshot(bar).offsets, held)
    bpy.ops.object.mode_set(mode="OBJECT")
    for _ in range(2):
        step()
    assert sessions.is_live(bar)
    rest = np.array([vertex.co for vertex in bar.data.vertices])
    shift = scenes.world_points(bar) - rest
    assert np.abs(shift[rest[:, 0] > 0.8] - [0, 0, 0.4]).max() < 0.1
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert not bar.modifiers and np.array_equal(scenes.world_points(bar), rest)


def test_a_modifier_added_before_binds_the_handles_anew():
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    moving.location.z += 0.3
    step()
    add_modifier(bar, "MIRROR")
    scenes.activate(bar)
    bpy.ops.object.modifier_move_to_index(modifier="Mirror", index=0)
    for _ in range(2):
        step()
    assert sessions.is_live(bar) and len(bpy.data.objects["Bar_offsets"].data.vertices) == len(
        local_points(bar)
    )
    assert local_points(bar)[:, 2].max() > 0.4
    bpy.ops.arapfields.live()
    rest = np.array([vertex.co for vertex in bar.data.vertices])
    assert [m.name for m in bar.modifiers] == ["Mirror"] and "Bar_offsets" not in bpy.data.objects
    assert np.array_equal(local_points(bar)[: len(rest)], rest.astype(np.float32))


def test_what_was_there_before_live_mode_comes_back_bit_for_bit():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.3
    bpy.ops.arapfields.deform(**scenes.QUICK)
    inputs.put(bar.modifiers[0], "Factor", 0.7)
    before, points = scenes.everything(bar), scenes.world_points(bar)
    bpy.ops.arapfields.live()
    moving.location.x += 0.3
    step()
    assert not np.array_equal(scenes.world_points(bar), points)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert scenes.everything(bar) == before and np.array_equal(scenes.world_points(bar), points)
    assert inputs.get(bar.modifiers[0], "Factor") > 0.69


def test_undone_steps_end_or_refresh_live_mode():
    """As after an undone step: a source that is not live in it, and one whose offsets are older."""
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    moving.location.z += 0.3
    step()
    shown = scenes.world_points(bar)
    motion.write(bar, motion.Motion(np.zeros((len(bar.data.vertices), 3), np.float32)))
    recovery.after_undo()
    step()
    assert sessions.is_live(bar) and np.abs(scenes.world_points(bar) - shown).max() < 0.05
    bar.arapfields.live_kind = ""
    recovery.after_undo()
    assert not sessions.live


@pytest.mark.parametrize("handle_moves", [False, True])
def test_played_frames_are_those_of_a_bake_where_an_armature_before_is_animated(handle_moves, tmp_path):
    bar, _, moving = scenes.bar_with_handles()
    add_modifier(bar, "ARMATURE")
    bone = bar.modifiers["Armature"].object.pose.bones["Second"]
    for frame, angle in ((1, 0.0), (6, 0.9)):
        bone.rotation_euler.z = angle
        bone.keyframe_insert("rotation_euler", frame=frame)
    moving.location.z += 0.2
    if handle_moves:
        moving.keyframe_insert("location", frame=1)
        moving.location.z += 0.3
        moving.keyframe_insert("location", frame=6)
    scene, shapes = bpy.context.scene, {}
    scene.frame_set(1)
    scenes.activate(bar)
    for way in ("PC2", "KEYS"):
        where = {"filepath": str(tmp_path / "bar.pc2")} if way == "PC2" else {}
        assert bpy.ops.arapfields.bake(format=way, start=1, end=6, **where) == {"FINISHED"}
        for frame in (1, 4, 6):
            scene.frame_set(frame)
            shapes[way, frame] = scenes.world_points(bar if way == "PC2" else bpy.data.objects["Bar_baked"])
        scene.frame_set(1)
        scenes.activate(bar)
        if way == "PC2":
            bpy.ops.arapfields.remove_bake()
    bar.hide_set(False)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    step(refined=True)
    for frame in (1, 6, 4):
        scene.frame_set(frame)
        step(refined=True)
        assert np.abs(scenes.world_points(bar) - shapes["PC2", frame]).max() < BY_HAND, frame
    for frame in (1, 4, 6):
        assert np.abs(shapes["KEYS", frame] - shapes["PC2", frame]).max() < KEYS_OFF, frame
    assert np.abs(shapes["PC2", 6] - shapes["PC2", 1]).max() > 0.5
