# SPDX-License-Identifier: GPL-3.0-or-later
"""The pin tool over what an object carries: a pin there would be the carrier's."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.pins import from_above

    from addon.pin_tool import hover

pytestmark = pytest.mark.in_blender


def met(x):
    target = hover.surface(bpy.context, from_above(x), True)
    return target and (target.source.name, round(float(target.location[2]), 3), round(target.normal[2], 3))


def dressed():
    """A bar, larger than its mesh, that carries a sheet above it, which is wider."""
    bar = scenes.bar()
    bar.scale, bar.rotation_euler = (1, 1, 2), (np.pi / 2, 0, 0)
    bpy.ops.mesh.primitive_plane_add(size=4.0, location=(0, 0, 0.6))
    sheet = bpy.context.object
    sheet.name = "Sheet"
    scenes.activate(sheet, bar)
    bpy.context.view_layer.update()
    return bar, sheet


def test_a_pin_on_what_is_carried_is_one_of_what_carries_it():
    bar, sheet = dressed()
    assert met(0.5) == ("Sheet", 0.6, 1.0)
    bpy.ops.arapfields.carry()
    assert met(0.5) == ("Bar", 0.25, 1.0)
    target = hover.surface(bpy.context, from_above(0.5), True)
    assert target.face_count == len(bar.data.polygons) and bar.data.polygons[target.face].normal.y > 0.9
    assert len(target.lit) and np.abs(target.lit - target.location).max() < 4 * target.radius
    beside = hover.surface(bpy.context, from_above(1.5), False)
    assert beside.source.name == "Bar" and np.allclose(beside.location, (1.0, 0.0, 0.25), atol=1e-5)
    bar.hide_set(True)
    assert met(0.5) == ("Sheet", 0.6, 1.0)
    bar.hide_set(False)
    sheet.location.z = -3  # below
    bpy.context.view_layer.update()
    assert met(0.5) == ("Bar", 0.25, 1.0)


def test_what_has_handles_of_its_own_keeps_them_and_what_is_released_is_met_again():
    bar, sheet = dressed()
    bpy.ops.arapfields.carry()
    assert bar.arapfields.carried[0].item == sheet
    scenes.activate(sheet)
    bpy.ops.arapfields.pin_add(location=(0.5, 0, 0.6), radius=0.1)
    assert met(0.5)[0] == "Sheet"
    sheet.arapfields.handles.clear()
    assert met(0.5)[0] == "Bar"
    scenes.activate(bar)
    bpy.ops.arapfields.release()
    assert met(0.5)[0] == "Sheet"
