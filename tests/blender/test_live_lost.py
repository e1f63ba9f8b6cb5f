# SPDX-License-Identifier: GPL-3.0-or-later
"""Live sources that users delete, edit or undo at the wrong moment."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.bones import rigged_bar
    from support.blender.live import step
    from support.blender.pins import pin
    from support.blender.scenes import delete
    from support.blender.stages import watched

    from addon.blender import modifier_stack
    from addon.core.runtime import jobs
    from addon.live import sessions

pytestmark = pytest.mark.in_blender


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
