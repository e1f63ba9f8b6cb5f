# SPDX-License-Identifier: GPL-3.0-or-later
"""The dots that show where a live shape presses."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.contact import lowest, pressed

    from addon.live import touching

pytestmark = pytest.mark.in_blender


def test_dots_come_back_with_what_undo_brings_back():
    """Of the shape that comes back, and none where it lies free."""
    bar, block, _ = pressed()
    down, size = bpy.data.objects["Moving"].location.z, max(bar.dimensions)
    bpy.data.objects["Moving"].location.z += 0.8
    scenes.activate(block, bar)
    bpy.ops.arapfields.add_obstacle()
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.arapfields.live(kind="DEFORM")
    lowest(bar)
    bpy.ops.ed.undo_push(message="live")
    bpy.data.objects["Moving"].location.z = down
    bpy.context.view_layer.update()
    lowest(bar)
    bpy.ops.ed.undo_push(message="down")
    pressing = touching.places()
    assert len(pressing) > 3
    for again, presses in zip("urururuurr", (0, 1, 0, 1, 0, 1, 0, None, 0, 1), strict=True):
        (bpy.ops.ed.undo if again == "u" else bpy.ops.ed.redo)()
        lowest(bpy.data.objects["Bar"])
        scenes.activate(bpy.data.objects["Bar"])
        found = touching.places()
        assert bool(len(found)) == bool(presses), (again, presses, len(found))
        if presses:
            nearest = np.linalg.norm(found[:, None] - pressing, axis=2).min(axis=1)
            assert nearest.max() < 0.05 * size
