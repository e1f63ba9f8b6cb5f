# SPDX-License-Identifier: GPL-3.0-or-later
"""Places and drags pins, as the pin tool does."""

import types

import bpy
import numpy as np
from mathutils import Vector
from support.blender import scenes
from support.blender.live import step

from addon.pin_tool import drag


def pin(source, location, radius=0.15, target=None, **further):
    """Places a pin at a location of the shown surface, and drags it to a target; returns its Empty."""
    dragged = drag.of_new_pin(bpy.context, source, np.array(location, float), radius, **further)
    if target is not None:
        dragged.move(bpy.context, target)
        step()
    dragged.end(bpy.context)
    bpy.context.view_layer.update()
    return dragged.empty.get()


def state(source):
    """Everything that a cancelled drag must not change, comparable."""
    settings, layer = source.arapfields, bpy.context.view_layer
    handles = [(e.empty.name, e.kind, e.anchor, tuple(e.rest), tuple(e.colour)) for e in settings.handles]
    empties = [
        (o.name, o.location[:], o.rotation_euler[:], o.rotation_quaternion[:], o.scale[:])
        for o in bpy.data.objects
    ]
    flags = settings.keep_rest, settings.active_handle, settings.live_kind, layer.objects.active.name
    chosen = sorted(o.name for o in bpy.context.selected_objects)
    shape = scenes.world_points(source).tobytes()
    kinds = bpy.data.objects, bpy.data.meshes, bpy.data.node_groups, bpy.data.scenes, source.modifiers
    return handles, empties, flags, chosen, shape, [sorted(kind.keys()) for kind in kinds]


def from_above(x, y=0.0):
    """A view along -z at a place."""
    matrix = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1.0]])
    ray = Vector((x, y, 5)), Vector((0, 0, -1))
    given = {"pixel": (200, 200), "perspective": matrix, "size": (400, 400), "scale": 1.0}
    return types.SimpleNamespace(ray=lambda: ray, towards=Vector((0, 0, 1)), **given)
