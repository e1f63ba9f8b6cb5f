# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode, stepped by hand: without a window Blender runs no timers."""

import tempfile
from unittest import mock

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step

    from addon.core.geometry import spaces
    from addon.core.runtime import jobs
    from addon.live import sessions
    from addon.live.live_solver import LiveSolver

pytestmark = pytest.mark.in_blender


def test_the_result_follows_moves_and_returns():
    bar, _, moving = scenes.bar_with_handles()
    before = scenes.world_points(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"} and sessions.is_live(bar)
    assert np.abs(scenes.world_points(bar) - before).max() < 1e-3
    moving.location.z += 0.4
    step()
    shift = scenes.world_points(bar) - before
    assert np.abs(shift[before[:, 0] < -0.8]).max() < 0.1
    assert np.abs(shift[before[:, 0] > 0.8] - [0, 0, 0.4]).max() < 0.1
    step(refined=True)
    finer = scenes.world_points(bar) - before
    assert 0 < np.abs(finer - shift).max() < 0.1
    scenes.activate(bar)
    bpy.ops.arapfields.reset_handle(all=True)
    step(refined=True)
    assert np.abs(scenes.world_points(bar) - before).max() < 0.02


def test_off_restores_what_was_there():
    bar, _, moving = scenes.bar_with_handles()

    def names():
        kinds = bpy.data.objects, bpy.data.meshes, bpy.data.collections, bpy.data.scenes
        return [sorted(kind.keys()) for kind in kinds]

    before = scenes.everything(bar), names()
    bpy.ops.arapfields.live()
    assert len(bar.modifiers) == 1 and len(bpy.context.scene.objects) == 3
    moving.location.z += 0.4
    step()
    moving.location.z -= 0.4
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert before == (scenes.everything(bar), names())
    assert not bar.modifiers and not bpy.data.node_groups and not bar.arapfields.live_kind


@pytest.mark.parametrize("target", ["MODIFIER", "REPLACE", "KEY", "NEW"])
def test_a_live_shape_can_be_kept(target):
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.result = target
    scenes.decorate(bar)
    whole, names = scenes.everything(bar), sorted(bpy.data.objects.keys())
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step()
    shown = scenes.world_points(bpy.data.objects["Bar_live"] if target == "NEW" else bar)
    scenes.activate(moving)
    assert bpy.ops.arapfields.live_keep() == {"FINISHED"}
    kept = bpy.data.objects["Bar_deformed"] if target == "NEW" else bar
    assert np.abs(scenes.world_points(kept) - shown).max() < 0.1
    contents = scenes.everything(kept)
    assert {key: value for key, value in contents.items() if key[0] != "ARAP Fields"} == whole
    assert len(bar.modifiers) == (target == "MODIFIER") and (bar.data.shape_keys is None) == (target != "KEY")
    if target == "NEW":
        assert "Bar_live" not in bpy.data.objects and bar.hide_render and bar.hide_get()
    else:
        assert sorted(bpy.data.objects.keys()) == names


def test_several_objects_are_live_at_once():
    pairs = [scenes.bar_with_handles(name) for name in ("One", "Two")]
    for bar, _, _ in pairs:
        scenes.activate(bar)
        bpy.ops.arapfields.live()
    rest = [scenes.world_points(bar) for bar, _, _ in pairs]
    pairs[0][2].location.z += 0.3
    pairs[1][2].location.z -= 0.3
    step()
    for (bar, _, _), before, sign in zip(pairs, rest, (1, -1), strict=True):
        moved = scenes.world_points(bar) - before
        assert np.abs(moved[before[:, 0] > 0.9][:, 2].mean() - 0.3 * sign) < 0.05


def test_a_new_handle_sets_the_solver_up_again():
    bar, _, _ = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    scenes.activate(bar)
    bpy.ops.arapfields.add_handle()
    step()
    assert sessions.is_live(bar) and len(sessions.live[bar.session_uid].layout[0]) == 3
    for _ in range(3):
        scenes.activate(bar)
        bpy.ops.arapfields.remove_handle()
    step()
    assert not sessions.is_live(bar) and not bar.modifiers


def test_playback_is_followed():
    bar, _, moving = scenes.bar_with_handles()
    for frame, height in ((1, 0.0), (9, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    right, heights = np.array([v.co.x for v in bar.data.vertices]) > 0.9, []
    for frame in (1, 5, 9):
        bpy.context.scene.frame_set(frame)
        step()
        heights.append(scenes.world_points(bar)[right][:, 2].mean())
    assert abs(heights[0]) < 0.02 and abs(heights[2] - 0.4) < 0.05 and np.all(np.diff(heights) > 0.1)


@pytest.mark.parametrize("target", ["MODIFIER", "NEW"])
def test_a_file_saved_while_live_shows_the_same_shape_as_a_result(target):
    """On the source, or on an object of its own; the panel says so, and nothing is live."""
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.result = target
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step()
    shown = scenes.world_points(bpy.data.objects["Bar" if target == "MODIFIER" else "Bar_live"])
    assert shown[:, 2].max() > 0.4
    path = tempfile.mktemp(suffix=".blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not sessions.live
    bpy.ops.wm.open_mainfile(filepath=path)
    bar = bpy.data.objects["Bar"]
    result = bar if target == "MODIFIER" else bpy.data.objects["Bar_deformed"]
    assert [item for item in bpy.data.objects if item.type == "MESH" and item.visible_get()] == [result]
    assert not result.hide_render and bar.hide_render == (target == "NEW")
    assert np.array_equal(scenes.world_points(result), shown)
    assert not bar.arapfields.live_kind and "Bar_live" not in bpy.data.objects
    assert [entry.kind for entry in bar.arapfields.results] == ([] if result == bar else ["DEFORM"])
    assert jobs.messages() == [
        ("INFO", "Bar: it was live when the file was saved; its shape is kept as a result")
    ]
    scenes.activate(bar)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}  # and updates that
    assert [item for item in bpy.data.objects if item.type == "MESH" and item.visible_get()] == [result]
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not jobs.messages()


def test_a_file_saved_after_the_live_object_was_deleted_tells_nothing_of_it():
    """Its handles keep it in the file."""
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step()
    scenes.activate(bar)
    bpy.ops.object.delete()
    step()
    path = tempfile.mktemp(suffix=".blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert "Bar" in bpy.data.objects and not bpy.data.objects["Bar"].arapfields.live_kind
    assert not jobs.messages()


def test_what_cannot_be_live_is_named():
    scenes.bar()
    with pytest.raises(RuntimeError, match="Bar has no handle"):
        bpy.ops.arapfields.live()
    with pytest.raises(RuntimeError, match="not live"):
        bpy.ops.arapfields.live_keep()


def test_a_look_at_handles_that_rest_computes_no_motion_again():
    *_, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    with mock.patch.object(spaces, "pose", wraps=spaces.pose) as computed:
        step()
        assert not computed.called
        moving.location.z += 0.1234  # as no other test moves it
        step()
        assert computed.called


def test_a_cancelled_move_leaves_no_trace_in_the_solver():
    """What comes back to a pose whose shape is known is solved as if it had never left."""
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=(0, 0, 0.9))
    scenes.activate(bar)
    bpy.context.object.select_set(True)
    bpy.data.objects["Cube"].select_set(True)
    bpy.ops.arapfields.add_obstacle()
    moving.location.z += 0.3
    bpy.context.view_layer.update()
    bpy.ops.arapfields.live()
    step(refined=True)
    session = sessions.live[bar.session_uid]
    asked = []
    session.worker.request, given = asked.append, session.worker.request
    cube = bpy.data.objects["Cube"]
    for x, z in ((0.3, 0.0), (0.0, 0.9)):  # through the bar, and back
        cube.location = (x, 0, z)
        bpy.context.view_layer.update()
        session.update(bpy.context)
        assert session.solver.returns == (z == 0.9)
    session.worker.request = given
    session.worker.stop()
    solver = session.solver
    solver.returns = False
    away = [*solver.solve(asked[0])][-1].points
    solver.returns = True
    back = [*solver.solve(asked[1])][-1].points
    fresh = LiveSolver(session.reader)
    fresh.prepare()
    other = [*fresh.solve(asked[1])][-1].points
    assert np.abs(away - back).max() > 0.01 and (back == other).all()
