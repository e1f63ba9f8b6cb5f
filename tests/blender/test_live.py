# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode: its shapes, the stack, renders, and how a session ends or gives way."""

import subprocess
import sys
import tempfile
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes, stages
    from support.blender.baking import animated
    from support.blender.live import pin, step
    from support.blender.scenes import camera, delete
    from support.blender.skins import rigged_bar
    from support.blender.stacks import add_modifier, build, local_points
    from support.blender.stages import watched

    from addon.blender import mesh_arrays, modifier_stack, references
    from addon.core.errors import UserError
    from addon.core.geometry import spaces
    from addon.core.runtime import jobs
    from addon.core.runtime.jobs import run_to_completion
    from addon.field_modifier import motion, node_group
    from addon.live import recovery, sessions
    from addon.live.live_solver import LiveSolver
    from addon.pin_tool import drag
    from addon.results.placement import placement_refusal

pytestmark = pytest.mark.in_blender

# Live mode, stepped by hand: without a window Blender runs no timers.


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


# Deform and Stylize pressed while an object is live: they take the pose, live mode ends by itself.

FINE = 0.03  # of the bar, by which a live shape and the solve of its pose may differ


def lifted(target="MODIFIER"):
    """(bar, its points at rest): live, its end lifted and the shape there."""
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.result = target
    rest = scenes.world_points(bar)
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    scenes.activate(bar)
    return bar, rest


@pytest.mark.parametrize("target", ["MODIFIER", "NEW", "REPLACE", "KEY"])
def test_deform_takes_the_live_pose(target):
    bar, rest = lifted(target)
    assert placement_refusal(bar) is None
    live = scenes.world_points(bar if target != "NEW" else bpy.data.objects["Bar_live"])
    assert bpy.ops.arapfields.deform(samples=2000) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert not sessions.live and not bar.arapfields.live_kind
    result = bpy.data.objects["Bar_deformed"] if target == "NEW" else bar
    shape = scenes.world_points(result)
    assert np.abs(shape - live).max() < FINE and shape[:, 2].max() > 0.5
    assert [m.name for m in bar.modifiers] == (["ARAP Fields"] if target == "MODIFIER" else [])
    assert "Bar_live" not in bpy.data.objects and len(shape) == len(rest)


def test_stylize_works_on_the_rest_shape_of_what_is_live():
    bar, rest = lifted()
    bpy.ops.arapfields.stylize(style="CUBE", **scenes.QUICK)
    bpy.context.view_layer.update()
    assert not sessions.live and not bar.arapfields.live_kind
    lift = scenes.world_points(bar)[:, 2].max() - rest[:, 2].max()
    assert abs(lift) < 0.2  # which is the handles' alone


def test_a_job_that_is_cancelled_leaves_the_live_shape():
    bar, _ = lifted()
    live = scenes.world_points(bar)
    present = stages.Stage("job")
    present.start(present.operator())
    assert not sessions.live
    jobs.stop()
    present.coroutine.close()
    bpy.context.view_layer.update()
    assert np.array_equal(scenes.world_points(bar), live) and not bar.arapfields.live_kind
    bpy.ops.arapfields.live()  # and goes on from there
    assert sessions.is_live(bar)


def test_a_refused_press_leaves_live_mode():
    bar, _ = lifted()
    live, reach = scenes.world_points(bar), bar.arapfields.handles[0]
    reach.reach = 0.3
    for press, given, words in (
        (bpy.ops.arapfields.stylize, {"style": "OBJECT"}, "Choose the object"),
        (bpy.ops.arapfields.deform, {"field": "neural"}, "has a reach"),
    ):
        with pytest.raises(RuntimeError, match=words):
            press(**given)
        assert sessions.is_live(bar) and bar.arapfields.live_kind == "DEFORM"
        assert np.array_equal(scenes.world_points(bar), live)


def test_undo_after_a_cancelled_job_brings_live_mode_back():
    bar, _ = lifted()
    live = scenes.world_points(bar)
    bpy.ops.ed.undo_push(message="live")
    present = stages.Stage("job")
    present.start(present.operator())
    jobs.running().cancel()
    assert run_to_completion(present.coroutine, lambda: jobs.running().join(0.05)) == {"CANCELLED"}
    jobs.stop()
    assert not sessions.live and not bar.arapfields.live_kind
    bpy.ops.ed.undo()
    step()
    bar = bpy.data.objects["Bar"]
    assert sessions.is_live(bar) and np.abs(scenes.world_points(bar) - live).max() < 1e-6


def test_pins_are_dragged_again_after_deform():
    bar = scenes.bar()
    bpy.ops.ed.undo_push(message="bar")
    dragged = drag.of_new_pin(bpy.context, bar, np.array([0.9, -0.25, 0.0]), 0.1)
    dragged.move(bpy.context, (0.9, -0.25, 0.4))
    step()
    dragged.end(bpy.context)
    live = scenes.world_points(bar)
    bpy.ops.ed.undo_push(message="drag")
    scenes.activate(bar)
    assert bpy.ops.arapfields.deform(samples=2000) == {"FINISHED"}
    bpy.ops.ed.undo_push(message="deform")
    assert not sessions.live and np.abs(scenes.world_points(bar) - live).max() < 0.1
    empty = bar.arapfields.handles[0].empty
    again = drag.of_entry(bpy.context, bar, bar.arapfields.handles[0])
    again.move(bpy.context, empty.location)
    step()
    again.end(bpy.context)
    assert sessions.is_live(bar)
    bpy.ops.ed.undo()
    bpy.context.view_layer.update()
    assert np.abs(scenes.world_points(bpy.data.objects["Bar"]) - live).max() < 1e-6


def shown_meshes():
    meshes = [item for item in bpy.context.scene.objects if item.type == "MESH"]
    return {item.name: scenes.world_points(item) for item in meshes}


def test_a_failed_run_that_ends_a_waiting_live_state_is_a_step_of_undo():
    """Undo has brought the state back, but an error keeps its session from starting again."""
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 50.0
    bpy.context.view_layer.update()
    scenes.activate(moving)
    bpy.ops.arapfields.set_rest()  # there it holds nothing, which the solve refuses
    bar.arapfields.live_kind = "DEFORM"
    sessions.live.paused.add(bar.session_uid)
    pushed = references.pushed
    with pytest.raises(RuntimeError, match="No part of the surface"):
        bpy.ops.arapfields.deform(**scenes.QUICK)
    assert not bar.arapfields.live_kind and references.pushed == pushed + 1
    bar.arapfields.live_kind = "DEFORM"
    sessions.live.paused.add(bar.session_uid)
    with pytest.raises(RuntimeError, match="No part of the surface"):
        bpy.ops.arapfields.live()
    assert not bar.arapfields.live_kind and references.pushed == pushed + 2


def test_a_refused_start_leaves_a_live_state_waiting():
    bar = scenes.bar()
    bar.data.clear_geometry()
    bar.arapfields.live_kind = "DEFORM"
    sessions.live.paused.add(bar.session_uid)
    with pytest.raises(UserError):
        sessions.begin(bpy.context, bar, "STYLIZE")
    bpy.context.view_layer.update()
    assert bar.arapfields.live_kind == "DEFORM" and bar.session_uid in sessions.live.paused


def referred_to():
    """session_uid of the objects in the scene, and of those that their modifiers refer to."""
    shown = list(bpy.context.scene.objects)
    helpers = {node_group.get(m, "Offsets") for item in shown for m in item.modifiers if m.type == "NODES"}
    return {item.session_uid for item in helpers.union(shown) - {None}}


@pytest.mark.parametrize("is_smooth", [False, True])
@pytest.mark.parametrize("result", ["MODIFIER", "NEW"])
@pytest.mark.parametrize("fails", ["at once", "later"])
def test_a_refused_press_of_another_kind_leaves_live_mode(result, fails, is_smooth):
    """Live Deform is refused while Live Stylize is on: that goes on, with its shape and no step of undo. No
    data are new: undo would leave modifiers with references to them."""
    bar = scenes.bar()
    if is_smooth:  # points are those of modifiers, and offsets lie on another mesh
        bar.modifiers.new("Smooth", "SUBSURF")
    bar.arapfields.result = result
    scenes.activate(bar)
    assert bpy.ops.arapfields.live(kind="STYLIZE") == {"FINISHED"}
    step(refined=True)
    if fails == "later":  # when the solver looks for what the handle holds
        far = scenes.cube_empty((9.0, 0.0, 0.0), (0.3, 0.6, 0.6))
        bpy.context.view_layer.update()
        scenes.activate(far, bar)
        bpy.ops.arapfields.add_handle()
        scenes.activate(bar)
    shown = {
        item.name: scenes.world_points(item) for item in bpy.context.scene.objects if item.type == "MESH"
    }
    pushed, objects = references.pushed, referred_to()
    with pytest.raises(RuntimeError, match="no handle" if fails == "at once" else "No part of the surface"):
        bpy.ops.arapfields.live(kind="DEFORM")
    step(refined=True)
    assert sessions.is_live(bar, "STYLIZE") and bar.arapfields.live_kind == "STYLIZE"
    assert references.pushed == pushed
    assert referred_to() == objects
    now = shown_meshes()
    assert now.keys() == shown.keys() and len(now) == (1 if result == "MODIFIER" else 2)
    for name, points in shown.items():
        assert np.array_equal(now[name], points), name


# Live sources that users delete, edit or undo at the wrong moment.


@pytest.mark.parametrize("which", ["source", "live object", "modifier"])
def test_live_ends_when_its_source_or_its_object_is_deleted(which):
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.result = "NEW" if which == "live object" else "MODIFIER"
    bpy.ops.arapfields.live()
    if which == "modifier":
        bar.modifiers.remove(bar.modifiers[0])
    else:
        delete(bar if which == "source" else bpy.data.objects["Bar_live"])
    moving.location.z += 0.4
    step()
    assert not sessions.live and "Bar_live" not in bpy.data.objects
    assert not bar.hide_render and not bar.arapfields.results
    if which != "source":  # which stays as it was, until that is undone
        assert not bar.modifiers and "ARAP Fields" not in bar.data.attributes


def test_a_deleted_source_comes_back_live_and_as_it_was():
    """Its pins keep it in the file, so that an undone step takes it as it is there."""
    bpy.context.preferences.edit.use_global_undo = True
    bar = scenes.bar()
    pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.4))
    bpy.ops.ed.undo_push(message="pin")
    shown = scenes.world_points(bar)
    delete(bar)
    bpy.ops.ed.undo_push(message="deleted")
    step()
    assert not sessions.live
    bpy.ops.ed.undo()
    step()
    bar = bpy.data.objects["Bar"]
    assert sessions.is_live(bar) and np.array_equal(scenes.world_points(bar), shown)


def test_a_modifier_that_was_removed_comes_back_live_with_undo():
    """Its armature, whose bones are handles, was off and nothing moved in its place."""
    bpy.context.preferences.edit.use_global_undo = True
    bar, rig = rigged_bar()
    scenes.activate(rig, bar)
    bpy.ops.arapfields.add_bones()
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    rig.pose.bones["Second"].rotation_euler.z = 0.7
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="posed")
    step(refined=True)
    posed = scenes.world_points(bar)
    bar.modifiers.remove(modifier_stack.find(bar))
    bpy.ops.ed.undo_push(message="removed")
    step()
    assert not sessions.live and "was removed" in str(jobs.messages())
    bpy.ops.ed.undo()  # the end of live mode
    bpy.ops.ed.undo()  # the removal
    step(refined=True)
    bar = bpy.data.objects["Bar"]
    assert sessions.is_live(bar) and np.abs(scenes.world_points(bar) - posed).max() < 1e-4


def test_edits_of_a_live_source_are_followed():
    bar, *_ = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    session = sessions.live[bar.session_uid]
    bar.data.update_tag()
    step()
    assert sessions.live[bar.session_uid] is session  # nothing was changed
    points = np.array([vertex.co for vertex in bar.data.vertices])
    points[:, 1] *= 1.5
    scenes.set_positions(bar.data, points)
    step()
    step()
    assert sessions.live[bar.session_uid] is not session
    assert np.abs(scenes.world_points(bar) - points).max() < 0.05


def test_an_edit_is_followed_that_comes_with_live_modes_own_change():
    """Both are one update of the dependency graph."""
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    step(refined=True)
    moving.location.z += 0.2
    step(refined=True)
    session = sessions.live[bar.session_uid]
    assert bar.session_uid in motion.written
    points = np.array([vertex.co for vertex in bar.data.vertices])
    scenes.set_positions(bar.data, points * [1.0, 1.5, 1.0])
    step()
    step()
    assert sessions.live[bar.session_uid] is not session
    assert np.ptp(local_points(bar)[:, 1]) > 1.3 * np.ptp(points[:, 1])


def test_live_waits_while_its_source_is_in_edit_mode():
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    scenes.activate(bar)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    step()
    assert sessions.is_live(bar)
    bpy.ops.object.mode_set(mode="OBJECT")
    step()
    step()
    assert sessions.is_live(bar)
    assert len(bar.data.attributes["ARAP Fields"].data) == len(bar.data.vertices)
    before = np.array([vertex.co for vertex in bar.data.vertices])
    moving.location.z += 0.4
    step()
    shift = scenes.world_points(bar) - before
    assert np.abs(shift[before[:, 0] > 0.8] - [0, 0, 0.4]).max() < 0.1


def test_a_live_object_that_undo_left_in_no_scene_goes_too():
    bar, *_ = scenes.bar_with_handles()
    bar.arapfields.result = "NEW"
    bpy.ops.arapfields.live()
    delete(bpy.data.objects["Bar_live"])
    bar.arapfields.results.clear()  # as in the step before
    bar.arapfields.live_kind = bar.arapfields.live_hidden = ""
    step()
    assert not sessions.live and "Bar_live" not in bpy.data.objects and "Bar_live" not in bpy.data.meshes


@pytest.mark.parametrize("linked", [False, True])
def test_a_copy_of_a_live_object_is_not_live(linked):
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    shown = scenes.world_points(bar)
    scenes.activate(bar)
    bpy.ops.object.duplicate(linked=linked)
    copied = bpy.context.object
    step(refined=True)
    assert sessions.is_live(bar) and not copied.arapfields.live_kind
    assert bpy.ops.arapfields.remove_field() == {"FINISHED"} and not copied.modifiers
    step(refined=True)
    assert sessions.is_live(bar) and np.array_equal(scenes.world_points(bar), shown)


@pytest.mark.parametrize("result", ["MODIFIER", "NEW"])
@pytest.mark.parametrize("linked", [False, True])
def test_what_was_live_in_another_file_is_not_live_where_it_is_appended(tmp_path, result, linked):
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.result = result
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    shown = scenes.world_points(bar)
    bpy.data.libraries.write(str(tmp_path / "live.blend"), {bar})
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    append = bpy.ops.wm.link if linked else bpy.ops.wm.append
    append(directory=str(tmp_path / "live.blend/Object"), filename="Bar")
    bar = bpy.data.objects["Bar"]
    bpy.context.view_layer.objects.active = bar
    bpy.context.view_layer.update()
    assert not bar.arapfields.live_kind and not sessions.is_live(bar)
    kept = [entry.item.name for entry in bar.arapfields.results]
    assert kept == (["Bar_deformed"] if result == "NEW" and not linked else [])
    assert bar.hide_render == bool(kept) and all(name in bpy.context.scene.objects for name in kept)
    assert np.array_equal(scenes.world_points(bar), shown)
    if not linked and not kept:
        assert bpy.ops.arapfields.live() == bpy.ops.arapfields.live() == {"FINISHED"}
        step(refined=True)
        assert np.array_equal(scenes.world_points(bar), shown)


def test_a_copy_of_a_live_object_does_not_come_back_live():
    """One that was never active, and so still says that it is live by the session of the other."""
    bpy.context.preferences.edit.use_global_undo = True
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    bpy.ops.ed.undo_push(message="live")
    shown, copied = scenes.world_points(bar), bar.copy()
    copied.data = bar.data.copy()
    bpy.context.collection.objects.link(copied)
    bpy.ops.ed.undo_push(message="copied")
    for change in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.redo):
        change()
        step(refined=True)
    bar, copied = bpy.data.objects["Bar"], bpy.data.objects["Bar.001"]
    assert sessions.is_live(bar) and not sessions.is_live(copied) and not copied.arapfields.live_kind
    assert np.array_equal(scenes.world_points(bar), shown)
    assert np.array_equal(scenes.world_points(copied), shown)


def test_a_linked_object_and_its_live_one_are_left_as_they_are(tmp_path):
    bar, *_ = scenes.bar_with_handles()
    bar.arapfields.result = "NEW"
    bpy.ops.arapfields.live()
    bpy.data.libraries.write(str(tmp_path / "live.blend"), {bar, bpy.data.objects["Bar_live"]})
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with watched() as errors:
        for name in ("Bar_live", "Bar"):
            bpy.ops.wm.link(directory=str(tmp_path / "live.blend/Object"), filename=name)
        bar = bpy.data.objects["Bar"]
        bpy.context.view_layer.objects.active = bar
        bpy.context.view_layer.update()
    assert not errors and not bar.arapfields.live_kind
    assert "Bar_live" in bpy.context.scene.objects


# What renders show of a source that is live, and of a file that is opened without the extension.


def picture(path):
    """(height, width, 4) pixels of a file."""
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    width, height = image.size
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)


def counted(item):
    """How many visible meshes of the evaluated scene are this source's or its results'."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    shown = [i.object.original for i in depsgraph.object_instances if i.object.type == "MESH"]
    return sum(one.name.startswith(item.name) and not one.hide_render for one in shown)


@pytest.mark.parametrize("target", ["MODIFIER", "NEW"])
def test_a_render_of_an_animation_follows_the_handles_while_live(target):
    bar = animated()
    bar.arapfields.result = target
    scene, folder = camera(), Path(tempfile.mkdtemp())
    scene.frame_set(1)
    bpy.ops.arapfields.live()
    assert counted(bar) == 1
    scene.frame_start, scene.frame_end, scene.render.filepath = 1, 5, str(folder / "frame")
    bpy.ops.render.render(animation=True)
    assert sessions.is_live(bar) and not sessions.live.is_rendering
    shown = bar if target == "MODIFIER" else bpy.data.objects["Bar_live"]
    heights = []
    for frame in range(1, 6):
        seen = picture(folder / f"frame{frame:04}.png")[:, :, 3] > 0.5
        scene.frame_set(frame)
        step(refined=True)
        points = scenes.world_points(shown)
        right = points[points[:, 0] > 0.7]
        rows = np.flatnonzero(seen[:, int((0.85 + 1.6) / 3.2 * 48)]) / 48 * 3.2 - 1.6
        assert abs(rows.mean() - right[:, 2].mean()) < 3.2 / 48 * 1.5, frame  # pixels
        heights.append(rows.mean())
    assert np.all(np.diff(heights) > 0.03), heights
    assert counted(bar) == 1


def test_a_handle_hidden_in_renders_is_said():
    jobs.board.messages.clear()
    animated()
    scene = camera(16)
    bpy.data.objects["Moving"].hide_render = True
    bpy.ops.arapfields.live()
    scene.frame_start, scene.frame_end, scene.render.filepath = 1, 2, tempfile.mkdtemp() + "/frame"
    bpy.ops.render.render(animation=True)
    said = [text for _, text in jobs.messages()]
    assert said == ["Bar: Renders do not follow what is hidden in them: Moving"]


def test_a_file_looks_the_same_without_the_extension():
    """Opened by a Blender that never heard of it: the same points bit for bit, the same picture."""
    for stack in (["FIELD", "SUBSURF"], ["MIRROR", "FIELD"]):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        build(stack)
        scene, folder = camera(), Path(tempfile.mkdtemp())
        bpy.data.objects["Bar"].modifiers["ARAP Fields"].show_viewport = True
        scene.render.filepath = str(folder / "with.png")
        bpy.ops.render.render(write_still=True)
        np.save(folder / "points.npy", local_points(bpy.data.objects["Bar"]))
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "file.blend"))
        script = f"""
import bpy, numpy as np
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.open_mainfile(filepath={str(folder / "file.blend")!r})
assert not hasattr(bpy.types.Object, "arapfields")
mesh = bpy.data.objects["Bar"].evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
flat = np.empty(3 * len(mesh.vertices), np.float32)
mesh.vertices.foreach_get("co", flat)
assert flat.tobytes() == np.load({str(folder / "points.npy")!r}).tobytes(), "points"
bpy.context.scene.render.filepath = {str(folder / "without.png")!r}
bpy.ops.render.render(write_still=True)
import os
os._exit(7)
"""
        program = bpy.app.binary_path  # empty where Blender is a module of Python
        command = [program, "-b", "--factory-startup", "--python-expr"] if program else [sys.executable, "-c"]
        done = subprocess.run([*command, script], capture_output=True, text=True)
        assert done.returncode == 7, done.stderr
        with_it, without = (picture(folder / f"{name}.png") for name in ("with", "without"))
        assert (with_it[:, :, 3] > 0.5).sum() > 100 and np.array_equal(with_it, without)


# Live mode among other modifiers: what moves before the field, and modes in which it pauses.

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
    node_group.put(bar.modifiers[0], "Factor", 0.7)
    before, points = scenes.everything(bar), scenes.world_points(bar)
    bpy.ops.arapfields.live()
    moving.location.x += 0.3
    step()
    assert not np.array_equal(scenes.world_points(bar), points)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert scenes.everything(bar) == before and np.array_equal(scenes.world_points(bar), points)
    assert node_group.get(bar.modifiers[0], "Factor") > 0.69


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
