# SPDX-License-Identifier: GPL-3.0-or-later
"""Bars that are stylized and then deformed."""

import bpy
import numpy as np
from support.blender import scenes
from support.blender.stacks import add_modifier

QUICK = {"field": "radial", "samples": 500}
STYLE = {"style": "CUBE", "field": "radial", "samples": 500}
SAME = 2e-6  # for a bar of length 2: single precision of added offsets


def with_handles(bar):
    """Adds handles at both ends of a bar; returns the right one."""
    boxes = [scenes.cube_empty((x, 0, 0), (0.3, 0.6, 0.6), str(x)) for x in (-1, 1)]
    bpy.context.view_layer.update()
    scenes.activate(*boxes, bar)
    assert bpy.ops.arapfields.add_handle() == {"FINISHED"}
    scenes.activate(bar)
    return boxes[1]


def styled(stack=(), **further):
    """(a bent bar, its stylized points, its points before)."""
    bar = scenes.bar()
    bar.data.vertices.foreach_set("co", np.ravel([bend(v.co) for v in bar.data.vertices]))
    for kind in stack:
        add_modifier(bar, kind)
    rest = scenes.world_points(bar)
    scenes.activate(bar)
    assert bpy.ops.arapfields.stylize(**STYLE, **further) == {"FINISHED"}
    shape = scenes.world_points(bpy.context.object)
    assert np.abs(shape - rest).max() > 0.05
    return bar, shape, rest


def bend(point):
    return point[0], point[1], point[2] + 0.4 * point[0] ** 2


def structure(item):
    """Everything except the shape that must not change, comparable."""
    settings = item.arapfields
    modifiers = [(m.name, m.type, m.show_viewport) for m in item.modifiers]
    modifiers += [m.node_group.name for m in item.modifiers if m.type == "NODES"]
    names = sorted(name for name, _ in item.data.attributes.items())
    return modifiers, names, settings.moved_by, settings.under_rig, sorted(bpy.data.objects.keys())
