# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of a walk of shapes (tests/fuzz/walk), and what is shown beside what the file says should be."""

import hashlib

import bmesh
import bpy
import numpy as np
from support.blender import scenes

from addon.blender import mesh_arrays, modifier_stack, user_preferences
from addon.blender.object_references import owner_of, settings_of
from addon.core.runtime.jobs import run_to_completion
from addon.live import sessions
from addon.results import placement
from addon.solver import frame_solver, setup
from addon.solver.frame_solver import FrameSolver
from addon.solver.source_reader import SourceReader

WAIT = 120  # seconds at most for a shape to settle; a busy machine needs them
NAMES = ("Bar", "Ball", "Shell")
FEW = {"coarse_centers": 10, "fine_centers": 40, "samples": 400}


def few_centers():
    """Solves take milliseconds, here and in what the walk compares them with; returns what ends that."""
    places = (setup, "SAMPLES"), (user_preferences, "machine_options"), (frame_solver, "STYLE")
    places += ((frame_solver, "options_of"),)
    before = [getattr(owner, name) for owner, name in places]
    label, tip, options = frame_solver.STYLE

    def options_of(name, values, machine):
        return before[3](name, values | FEW if name == "live" else values, machine)

    def put(values):
        for (owner, name), value in zip(places, values, strict=True):
            setattr(owner, name, value)

    put([800, lambda: {"threads": 1}, (label, tip, options | FEW), options_of])
    return lambda: put(before)


def empty_file():
    bpy.ops.wm.read_factory_settings(use_empty=True)


def build():
    """A bar that is turned as an import is, a stretched ball under a parent with modifiers, an open shell."""
    empty_file()
    edit = bpy.context.preferences.edit
    edit.use_global_undo, edit.undo_steps = True, 64
    scenes.bar("Bar").rotation_euler.x = np.pi / 2
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, location=(4, 0, 0))
    ball = bpy.context.object
    ball.name, ball.scale, ball.rotation_euler = "Ball", (1.0, 0.7, 1.6), (0.3, 0.2, 0.9)
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.collection.objects.link(parent)
    parent.scale, parent.rotation_euler, ball.parent = (1.5, 1.5, 1.5), (0.1, 0.7, 0.0), parent
    ball.modifiers.new("Twist", "SIMPLE_DEFORM").angle = 0.4
    ball.modifiers.new("Fine", "SUBSURF").levels = 1
    bpy.ops.mesh.primitive_cube_add(location=(8, 0, 0), rotation=(0.4, 0.2, 0.1))
    bpy.context.object.name = "Die"
    shell = scenes.bar("Shell")
    shell.location, shell.scale = (0, 4, 0), (0.5, 0.5, 0.5)
    edited = bmesh.new()
    edited.from_mesh(shell.data)
    bmesh.ops.delete(edited, geom=[f for f in edited.faces if f.normal.z > 0.9], context="FACES")
    edited.to_mesh(shell.data)
    edited.free()
    bpy.context.view_layer.update()


def sources():
    """The objects of the walk that are in the scene, by name; a walk may rename them."""
    items = bpy.context.view_layer.objects
    return [item for item in items if item.type == "MESH" and item.get("walks", item.name) in NAMES]


def strays():
    """Handles whose Empty is gone, or is not theirs."""
    return [
        (item.name, index, entry.empty and entry.empty.name)
        for item in sources()
        for index, entry in enumerate(settings_of(item).handles)
        if entry.empty is None or owner_of(entry.empty) != item
    ]


def settle():
    """As the timer does, until every shape is as good as it gets."""
    for _ in range(5):
        before = dict(sessions.live)
        bpy.context.view_layer.update()
        sessions.update(bpy.context, wait=WAIT, refined=True)
        if before == sessions.live:  # no solver was set up anew
            break
    bpy.context.view_layer.update()


def shape(source):
    """(n, 3) points just after the field's modifier, in local coordinates."""
    if modifier_stack.find(source) is None:
        shown = modifier_stack.evaluated_mesh(bpy.context, source, in_place=True)
    else:
        shown = modifier_stack.moved_mesh(bpy.context, source)
    with shown as mesh:
        return mesh_arrays.positions(mesh)


def fresh_shape(source, kind):
    """The same by a new solver, from rest, of what the file says."""
    settings = settings_of(source)
    reader = SourceReader(bpy.context, source, kind, placement.in_place(settings.output, settings.result))
    run_to_completion(reader.read_setup(bpy.context))
    solver = FrameSolver(setup.sampled(reader.setup), reader.carrying)
    return solver.solve_from_rest(reader.request(bpy.context)).points


def difference(shown, expected):
    """The largest distance as a share of the size."""
    if len(shown) != len(expected):
        return np.inf
    return float(np.linalg.norm(shown - expected, axis=1).max() / np.ptp(expected, axis=0).max())


def everything():
    """{name: (place, digest of what is seen)} of all objects, to be compared bit for bit."""
    found = {}
    for item in bpy.context.view_layer.objects:
        seen = hashlib.sha1(scenes.world_points(item).tobytes()).hexdigest() if item.type == "MESH" else ""
        found[item.name] = [round(x, 6) for row in item.matrix_world for x in row], seen
    return found
