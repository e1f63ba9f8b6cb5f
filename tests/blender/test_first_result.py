# SPDX-License-Identifier: GPL-3.0-or-later
"""What a running solve shows on the source itself: nothing of it stays, in no step of undo either."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.wraps import rigged_bar

    from addon import lifecycle
    from addon.blender import modifier_stack, timers
    from addon.core.runtime import threads
    from addon.deform.first_result import FirstResult, steps
    from addon.field_modifier import motion
    from addon.live import sessions
    from addon.names import OFFSETS
    from addon.surface.source_surface import read_surface

pytestmark = pytest.mark.in_blender


def test_what_is_shown_is_put_back_bit_for_bit():
    bar, *_ = scenes.bar_with_handles()
    for earlier in (False, True):
        if earlier:
            assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
        before = state(bar)
        first, moved = first_result(bar)
        for share in (0.5, 1.0):
            first.show((first.points + share * (moved - first.points)).astype(np.float32))
        shown = scenes.world_points(bar)
        expected = first._surface.space.solve_to_world
        expected = moved @ expected[:3, :3].T + expected[:3, 3]
        assert np.abs(shown - expected).max() < 1e-5  # single precision
        first.clear()
        assert state(bar) == before
        first.clear()
        assert state(bar) == before


def test_the_field_keeps_the_place_below_the_armature_that_a_wrap_took_for_it():
    item, _ = rigged_bar()
    item.arapfields.under_rig = True
    place = modifier_stack.place(item)
    first, moved = first_result(item)
    first.show(moved.astype("f4"))
    assert [m.type for m in item.modifiers] == ["NODES", "ARMATURE"]
    first.clear()
    assert [m.type for m in item.modifiers] == ["ARMATURE"]
    assert modifier_stack.place(item) == place == 0


def test_steps_that_were_pushed_meanwhile_hold_nothing_of_it():
    bpy.context.preferences.edit.use_global_undo = True
    for earlier in (False, True):
        bar, *_ = scenes.bar_with_handles(f"Bar {earlier}")
        name = bar.name
        if earlier:
            assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="before")
        before = state(bar)
        first, moved = first_result(bar)
        first.show(moved.astype("f4"))
        assert state(bar) != before
        bpy.ops.ed.undo_push(message="between")
        first.clear()
        assert state(bar) == before
        bpy.ops.ed.undo_push(message="after")
        for step in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo, bpy.ops.ed.undo):
            step()
            assert state(bpy.data.objects[name]) == before


def test_an_undone_step_takes_the_helper_of_a_shared_mesh_away():
    """The object behind its source in Blender's list, whose memory the next look at that would read."""
    bar = scenes.bar()
    bpy.data.objects.new("Twin", bar.data)
    motion.bind(bpy.context, bar)
    steps.note(bar, motion.snapshot(bar), None)
    lifecycle.after_restore()
    steps.clear()
    assert [item.name for item in bpy.data.objects] == ["Bar", "Twin"]


def test_a_first_result_waits_for_the_end_of_edit_mode():
    bar, *_ = scenes.bar_with_handles()
    before = state(bar)
    first, moved = first_result(bar)
    first.show(moved.astype("f4"))
    bpy.ops.object.mode_set(mode="EDIT")
    first.show(first.points.astype("f4"))
    first.clear()
    (waiting,) = [function for function in timers.running() if function.__name__ == "attempt"]
    assert waiting() > 0
    bpy.ops.object.mode_set(mode="OBJECT")
    assert waiting() is None
    timers.clear()
    assert state(bar) == before


def test_a_mesh_that_changed_is_left_alone():
    bar, *_ = scenes.bar_with_handles()
    first, moved = first_result(bar)
    bar.data = bar.data.copy()
    bar.data.clear_geometry()
    first.show(moved.astype("f4"))
    assert not bar.modifiers and OFFSETS not in bar.data.attributes
    bpy.data.objects.remove(bar)
    first.show(moved.astype("f4"))
    first.clear()


def test_no_thread_works_on_when_the_process_ends():
    bar, *_ = scenes.bar_with_handles()
    sessions.begin(bpy.context, bar)
    assert threads.own_threads()
    lifecycle.end_threads()
    assert not threads.own_threads()
    sessions.live.clear()


def first_result(bar):
    """What shows a solve of this object, and (n, 3) moved points in solve space."""
    first = FirstResult(read_surface(bpy.context, bar, in_place=True))
    moved = first.points.copy()
    moved[:, 2] += 0.2 * moved[:, 0] ** 2
    return first, moved


def state(bar):
    """All that a first result touches, comparable bit for bit."""
    bpy.context.view_layer.update()
    names = [sorted(getattr(bpy.data, kind).keys()) for kind in ("objects", "meshes", "node_groups")]
    attributes = [(a.name, a.domain, a.data_type) for a in bar.data.attributes]
    stack = [(m.name, m.type, m.show_viewport) for m in bar.modifiers]
    return names, sorted(attributes), stack, scenes.world_points(bar).tobytes()
