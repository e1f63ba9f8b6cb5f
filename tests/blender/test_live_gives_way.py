# SPDX-License-Identifier: GPL-3.0-or-later
"""Deform and Stylize pressed while an object is live: they take the pose, live mode ends by itself."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes, stages
    from support.blender.live import step

    from addon.blender import undo_steps
    from addon.core.runtime import jobs
    from addon.core.runtime.coroutines import run_to_completion
    from addon.live import sessions
    from addon.pin_tool import drag
    from addon.results.placement import placement_refusal

pytestmark = pytest.mark.in_blender

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


@pytest.mark.parametrize("result", ["MODIFIER", "NEW"])
@pytest.mark.parametrize("fails", ["at once", "later"])
def test_a_refused_press_of_another_kind_leaves_live_mode(result, fails):
    """Live Deform is refused while Live Stylize is on: that goes on, with its shape and no step of undo."""
    bar = scenes.bar()
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
    pushed = undo_steps.pushed
    with pytest.raises(RuntimeError, match="no handle" if fails == "at once" else "No part of the surface"):
        bpy.ops.arapfields.live(kind="DEFORM")
    step(refined=True)
    assert sessions.is_live(bar, "STYLIZE") and bar.arapfields.live_kind == "STYLIZE"
    assert undo_steps.pushed == pushed
    now = shown_meshes()
    assert now.keys() == shown.keys() and len(now) == (1 if result == "MODIFIER" else 2)
    for name, points in shown.items():
        assert np.array_equal(now[name], points), name
