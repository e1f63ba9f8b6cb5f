# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen of a drag with the pin tool while it goes on."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    from addon.live import sessions
    from addon.pin_tool import drag

pytestmark = pytest.mark.in_blender


def test_the_shape_moves_with_the_pin_in_the_same_picture():
    bar = scenes.bar()
    dragged = drag.of_new_pin(bpy.context, bar, np.array([0.9, -0.25, 0.0]), 0.1)
    sessions.update(bpy.context, wait=30)
    # However busy the machine is: the picture waits for its shape.
    moment, drag.SHAPE_WAIT = drag.SHAPE_WAIT, 30.0
    moved = []
    for height in (0.1, 0.2, 0.3, 0.4):
        before = scenes.world_points(bar)
        dragged.move(bpy.context, (0.9, -0.25, height))
        moved.append(float(np.abs(scenes.world_points(bar) - before).max()))
    drag.SHAPE_WAIT = moment
    assert min(moved) > 0.02, moved
    dragged.cancel(bpy.context)


def test_pins_that_leave_nothing_far_are_dragged_all_the_same():
    """What keeps its place beyond all pins is no handle then."""
    bar = scenes.bar()
    for x in (0.9, -0.9):
        dragged = drag.of_new_pin(bpy.context, bar, np.array([x, -0.25, 0.0]), 0.1)
        dragged.move(bpy.context, (x, -0.25, 0.3))
        dragged.end(bpy.context)
        assert sessions.is_live(bar)
        off = np.linalg.norm(scenes.world_points(bar) - (x, -0.25, 0.3), axis=1).min()
        assert off < 0.2, off
        bar.arapfields.keep_beyond = 10.0
