# SPDX-License-Identifier: GPL-3.0-or-later
"""Live sessions, pins, styles and contact in scenes."""

import types

import bpy
import numpy as np
from mathutils import Vector
from support.blender import scenes
from support.blender.stacks import local_points

from addon.live import sessions
from addon.pin_tool import drag
from addon.solver import frame_solver

# Steps live sources, as their timer does.

WAIT = 300  # seconds to wait for a shape on a busy machine


def step(refined=False):
    bpy.context.view_layer.update()
    sessions.update(bpy.context, wait=WAIT, refined=refined)


# Places and drags pins, as the pin tool does.


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


# A ball to stylize, and settings of quick solves.


def ball(name="Ball"):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4)
    bpy.context.object.name = name
    scenes.nudge(bpy.context.object.data)
    return bpy.context.object


SETTINGS = {"result": "NEW", "iterations": 60, "samples": 2000, "batch": 200, "width": 32, "layers": 2}


# A live bar pressed onto a block.


def pressed():
    """A live bar with one end moved down onto a block."""
    frame_solver.SAMPLES = (
        3000  # as many as live solvers have by default: between fewer samples a corner could pass
    )
    bar, _, moving = scenes.bar_with_handles()
    low = (bar.matrix_world @ bar.data.vertices[0].co).z
    for vertex in bar.data.vertices:
        low = min(low, (bar.matrix_world @ vertex.co).z)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(moving.location.x, moving.location.y, low - 0.7))
    block = bpy.context.object
    moving.location.z -= 0.8
    scenes.activate(bar)
    return bar, block, low


def lowest(bar):
    sessions.update(bpy.context, wait=600, refined=True)
    return (local_points(bar) @ np.array(bar.matrix_world)[:3, :3].T + np.array(bar.matrix_world)[:3, 3])[
        :, 2
    ].min()
