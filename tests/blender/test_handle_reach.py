# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles that reach so far only: beyond, nothing moves."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import RUN, cache_file
    from support.blender.live import step
    from support.blender.pins import pin
    from support.blender.stacks import local_points

    from addon.pin_tool import drag
    from addon.pin_tool.modal import reach_steps
    from addon.viewport.handle_boxes import segments

pytestmark = pytest.mark.in_blender

REACH = 0.6


def reaching_bar(scale=(1.0, 1.0, 1.0)):
    """(bar, handle, rest, which points are beyond): its end is pulled, by a handle that reaches 0.6."""
    bar, _, moving = scenes.bar_with_handles()
    bar.rotation_euler.z, bar.scale = 0.3, scale
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.reset_handle(all=True)
    bpy.context.view_layer.update()
    rest, entry = local_points(bar), bar.arapfields.handles[1]
    entry.reach = REACH
    moving.location.z += 0.3
    bpy.context.view_layer.update()
    return bar, entry, rest, rest[:, 0] < 0.7 - REACH  # nothing left of 0.75 is held


@pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (1.3, 0.8, 1.0)])
def test_beyond_its_reach_nothing_moves_to_the_last_bit(scale):
    bar, entry, rest, beyond = reaching_bar(scale)
    assert beyond.sum() > 100
    bpy.ops.arapfields.deform(**RUN)
    assert np.array_equal(local_points(bar)[beyond], rest[beyond])
    assert np.abs(local_points(bar) - rest).max() > 0.1
    bpy.ops.arapfields.live()
    step()
    assert np.array_equal(local_points(bar)[beyond], rest[beyond])
    assert np.abs(local_points(bar) - rest).max() > 0.1
    entry.reach = 0.0
    step()
    assert np.abs(local_points(bar)[beyond] - rest[beyond]).max() > 1e-3
    entry.reach = 0.3
    step()
    assert np.array_equal(local_points(bar)[rest[:, 0] < 0.4], rest[rest[:, 0] < 0.4])
    bpy.ops.arapfields.live()


def test_a_bake_heeds_the_reach():
    bar, entry, rest, beyond = reaching_bar()
    z = entry.empty.location.z
    for frame, height in ((1, z - 0.3), (3, z)):
        entry.empty.location.z = height
        entry.empty.keyframe_insert("location", frame=frame)
    bpy.ops.arapfields.bake(start=1, end=3, filepath=cache_file())
    for frame in (2, 3):
        bpy.context.scene.frame_set(frame)
        assert np.array_equal(local_points(bar)[beyond], rest[beyond])
        assert np.abs(local_points(bar) - rest).max() > 0.1


def test_what_cannot_heed_a_reach_says_so_and_a_style_acts_everywhere():
    bar, _, rest, beyond = reaching_bar()
    for options in ({"field": "neural"}, {"exact_handles": True}):
        with pytest.raises(RuntimeError, match="Moving has a reach; take the method Fast"):
            bpy.ops.arapfields.deform(**options)
    assert np.array_equal(local_points(bar), rest)
    bar.arapfields.stylize.use_handles = True
    assert bpy.ops.arapfields.stylize(samples=1500, iterations=15) == {"FINISHED"}
    assert np.abs(local_points(bar)[beyond] - rest[beyond]).max() > 1e-3
    scenes.activate(bar)


def test_the_wheel_changes_the_reach_in_a_drag_and_cancel_takes_it_back():
    bar = scenes.bar()
    rest = local_points(bar)
    empty = pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.5))
    (entry,) = bar.arapfields.handles
    assert entry.reach == 0.0 and not np.array_equal(local_points(bar)[rest[:, 0] < 0], rest[rest[:, 0] < 0])
    dragged = drag.of_entry(bpy.context, bar, entry)
    dragged.move(bpy.context, (1.0, 0.0, 0.6))
    dragged.change_reach(bpy.context, -1)
    size = float(np.linalg.norm(np.ptp(np.array(bar.bound_box), axis=0)))  # as shown
    assert abs(entry.reach - size) < 0.1 * size and entry.reach > 2
    dragged.change_reach(bpy.context, -10)
    step()
    dragged.end(bpy.context)
    assert 0.7 < entry.reach < 0.9
    beyond = rest[:, 0] < 1.0 - 0.15 - entry.reach - 0.01
    assert beyond.any() and np.array_equal(local_points(bar)[beyond], rest[beyond])
    before, kept = local_points(bar).tobytes(), entry.reach
    dragged = drag.of_entry(bpy.context, bar, entry)
    dragged.change_reach(bpy.context, 5)
    step()
    dragged.cancel(bpy.context)
    assert entry.reach == kept and local_points(bar).tobytes() == before
    dragged = drag.of_entry(bpy.context, bar, entry)
    dragged.change_reach(bpy.context, -100)
    assert 0.1 < entry.reach < 0.2  # the pin's own radius
    dragged.change_reach(bpy.context, 100)
    assert entry.reach == 0.0
    dragged.cancel(bpy.context)
    assert empty.name == "Pin 1"


def test_the_keys_are_those_of_proportional_editing():
    def event(type_, ctrl=False, value="PRESS"):
        return SimpleNamespace(type=type_, ctrl=ctrl, value=value)

    assert reach_steps(event("PAGE_UP")) == 1 and reach_steps(event("PAGE_DOWN")) == -1
    assert reach_steps(event("WHEELDOWNMOUSE", True)) == 1 and reach_steps(event("WHEELUPMOUSE", True)) == -1
    assert reach_steps(event("WHEELUPMOUSE")) == 0  # turns to zooming
    assert reach_steps(event("PAGE_UP", value="RELEASE")) == 0


def test_the_reach_is_drawn_about_a_selected_handle():
    bar = scenes.bar()
    bar.scale = (2, 2, 2)
    bpy.context.view_layer.update()
    empty = pin(bar, (2.0, 0.0, 0.5))
    (entry,) = bar.arapfields.handles
    assert segments(bar) == []
    entry.reach = 0.4
    ((_, _, ends),) = segments(bar)
    away = np.linalg.norm(np.array(ends) - np.array(empty.matrix_world.translation), axis=1)
    assert np.abs(away - (0.8 + 0.15)).max() < 1e-5  # in the world, from the pin's rim
    bar.arapfields.active_handle = -1
    assert segments(bar) == []
