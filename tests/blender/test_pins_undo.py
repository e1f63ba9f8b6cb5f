# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo and redo of pins: what a step holds comes back bit for bit, and no solver answers to it."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import WAIT, step
    from support.blender.pins import pin, state

    from addon.live import sessions
    from addon.pin_tool import drag
    from addon.solver import setup

pytestmark = pytest.mark.in_blender

ROUNDS = 2


def test_rounds_of_undo_and_redo_are_exact():
    setup.SAMPLES = 500
    scenes.bar()
    bpy.context.preferences.edit.use_global_undo = True
    states = []
    targets = (None, (1.0, 0.0, 0.6), (-1.0, 0.1, 0.5), (0.0, 0.0, -0.4))
    for number, target in enumerate(targets):
        if target is not None:
            bar = bpy.data.objects["Bar"]
            start = scenes.world_points(bar)[(0, 3, 40)[number - 1]]
            pin(bar, start, 0.1, target=target)
            sessions.update(bpy.context, wait=WAIT, refined=True)
        bpy.ops.ed.undo_push(message=f"step {number}")
        states.append(state(bpy.data.objects["Bar"]))
    assert len({str(one) for one in states}) == len(states)

    def settled():
        bpy.context.view_layer.update()
        sessions.update(bpy.context, wait=WAIT, refined=True)
        return state(bpy.data.objects["Bar"])

    def same(found, kept):
        """All but whether the object is live: that ends where a step knows of none."""
        return found[:2] == kept[:2] and found[3:] == kept[3:]

    for _ in range(ROUNDS):
        for step in (2, 1, 0):
            bpy.ops.ed.undo()
            assert same(settled(), states[step]), step
        for step in (1, 2, 3):
            bpy.ops.ed.redo()
            assert same(settled(), states[step]), step


def test_a_drag_after_an_undone_one_starts_from_what_is_shown():
    scenes.bar()
    bpy.context.preferences.edit.use_global_undo = True
    pin(bpy.data.objects["Bar"], (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.5))
    bpy.ops.ed.undo_push(message="first")
    bar = bpy.data.objects["Bar"]
    shown = scenes.world_points(bar)
    dragged = drag.of_entry(bpy.context, bar, bar.arapfields.handles[0])
    dragged.move(bpy.context, (1.0, 0.4, 0.9))
    step()
    dragged.end(bpy.context)
    bpy.ops.ed.undo_push(message="second")
    bpy.ops.ed.undo()
    sessions.update(bpy.context, wait=WAIT)
    bar = bpy.data.objects["Bar"]
    assert np.array_equal(scenes.world_points(bar), shown)
    dragged = drag.of_entry(bpy.context, bar, bar.arapfields.handles[0])
    dragged.move(bpy.context, (1.0, 0.0, 0.5 + 1e-3))
    step()
    assert 0 < np.abs(scenes.world_points(bar) - shown).max() < 0.02


def test_an_anchor_in_a_live_style_that_waits_for_a_handle_holds_the_shape():
    """The solver is set up anew for the first handle; the shape that is shown stays until a handle moves."""
    scenes.bar()
    bar = bpy.data.objects["Bar"]
    assert bpy.ops.arapfields.live(kind="STYLIZE") == {"FINISHED"}
    step(refined=True)
    bar.arapfields.stylize.use_handles = True
    step(refined=True)
    shown = scenes.world_points(bar)
    dragged = drag.of_new_pin(bpy.context, bar, (1.0, 0.0, 0.25), 0.2, anchor=True)
    dragged.end(bpy.context)
    step(refined=True)
    assert sessions.is_live(bar, "STYLIZE") and np.array_equal(scenes.world_points(bar), shown)
    dragged = drag.of_entry(bpy.context, bar, bar.arapfields.handles[0])
    dragged.move(bpy.context, (1.0, 0.0, 0.6))
    step()
    assert np.abs(scenes.world_points(bar) - shown).max() > 0.1
