# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of walks: of shapes and of everything, and what must be shown or restored by undo and load."""

import hashlib

import bmesh
import bpy
import numpy as np
from support.blender import scenes

from addon.blender import mesh_arrays, modifier_stack, references, user_preferences
from addon.blender.evaluation import is_disabled
from addon.blender.object_references import in_view, owner_of, settings_of
from addon.core.runtime.jobs import run_to_completion
from addon.live import sessions
from addon.results import placement
from addon.solver import frame_solver
from addon.solver.frame_solver import FrameSolver
from addon.solver.source_reader import SourceReader

# The scene of a walk of everything, and what must be as it was after undo and load.

SMALL = {  # settings of each object, so that solves take milliseconds
    "deform": {"iterations": 4, "samples": 300},
    "stylize": {"iterations": 4, "samples": 300},
    "wrap": {"samples": 300, "centers": 20, "stages": 1, "iterations": 2},
    "fit": {"iterations": 8, "width": 8, "layers": 2, "near_points": 300, "uniform_points": 100},
    "bake": {"range": "CUSTOM", "start": 1, "end": 2},
}


def small(item):
    settings = settings_of(item)
    for group, values in SMALL.items():
        for name, value in values.items():
            if getattr(getattr(settings, group), name, value) != value:
                setattr(getattr(settings, group), name, value)
    if settings.resolution != 12:
        settings.resolution = 12


def begin_file():
    empty_file()
    edit = bpy.context.preferences.edit
    edit.use_global_undo, edit.undo_steps = True, 64
    bpy.context.scene.frame_end = 3


def build(seed):
    """Three to six objects; most have handles, some modifiers, keys, a parent or an armature."""
    begin_file()
    rng = np.random.default_rng(seed)
    for number in range(rng.integers(3, 7)):
        MAKERS[rng.integers(len(MAKERS))](rng, f"Object{number}", (0.0, 3.0 * number, 0.0))
    bpy.context.view_layer.update()


def bar(rng, name, place, handles=True):
    item = scenes.bar(name)
    item.location = place
    small(item)
    bpy.context.view_layer.update()
    if handles and rng.random() < 0.8:
        give_handles(item)
    return item


def give_handles(item):
    place = np.array(item.matrix_world.translation)
    ends = [
        scenes.cube_empty(np.add(place, (x, 0, 0)), (0.25, 0.5, 0.5), f"{item.name} {x}") for x in (-1, 1)
    ]
    bpy.context.view_layer.update()
    scenes.activate(*ends, item)
    bpy.ops.arapfields.add_handle()
    ends[1].location.z += 0.3
    scenes.activate(item)


def generated(rng, name, place):
    item = bar(rng, name, place, handles=False)
    kind = str(rng.choice(("MIRROR", "SUBSURF", "TRIANGULATE", "WELD", "ARRAY", "SIMPLE_DEFORM")))
    item.modifiers.new(kind.title(), kind)
    bpy.context.view_layer.update()
    if rng.random() < 0.7:
        give_handles(item)


def keyed(rng, name, place):
    item = bar(rng, name, place)
    item.shape_key_add(name="Basis")
    item.shape_key_add(name="Key").data[0].co.z += 0.2
    group = item.vertex_groups.new(name="Group")
    group.add(list(range(40)), 1.0, "REPLACE")


def posed(rng, name, place):
    item = bar(rng, name, place, handles=rng.random() < 0.5)
    bones = bpy.data.armatures.new(f"{name} Bones")
    rig = bpy.data.objects.new(f"{name} Rig", bones)
    rig.location = place
    bpy.context.collection.objects.link(rig)
    scenes.activate(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    bone = bones.edit_bones.new("Bone")
    bone.head, bone.tail = (-1, 0, 0), (1, 0, 0)
    bpy.ops.object.mode_set(mode="OBJECT")
    item.vertex_groups.new(name="Bone").add(list(range(len(item.data.vertices))), 1.0, "REPLACE")
    item.modifiers.new("Armature", "ARMATURE").object = rig
    scenes.activate(item)


def turned(rng, name, place):
    item = bar(rng, name, place)
    parent = bpy.data.objects.new(f"{name} Parent", None)
    bpy.context.collection.objects.link(parent)
    parent.scale, parent.rotation_euler = (1.5, 1.5, 1.0), (0.1, 0.7, 0.0)
    item.parent, item.scale = parent, (1.0, 0.7, 1.3)


def curve(rng, name, place):
    bpy.ops.curve.primitive_bezier_curve_add(location=place)
    bpy.context.object.name = name


def lattice(rng, name, place):
    item = bpy.data.objects.new(name, bpy.data.lattices.new(name))
    item.location = place
    bpy.context.collection.objects.link(item)


MAKERS = (bar, bar, generated, generated, keyed, posed, turned, curve, lattice)


def sources():
    return [item for item in in_view(bpy.context) if item.type == "MESH"]


def picture():
    """{full name: what is seen of an object of this file and said of it}, to be compared exactly."""
    found = {}
    for item in in_view(bpy.context):
        if item.library is not None:
            continue
        settings, seen = settings_of(item), not is_disabled(item)
        session = sessions.live.get(item.session_uid)
        swings = session is not None and session.has_motion  # secondary motion goes on from tick to tick
        is_shown = seen and item.type == "MESH" and not swings
        points = scenes.world_points(item).tobytes() if is_shown else b""
        found[item.name_full] = {
            "place": [round(x, 5) for row in item.matrix_world for x in row] if seen else [],
            "points": hashlib.sha1(points).hexdigest(),
            "hidden": [item.hide_get(), item.hide_render, item.hide_viewport, settings.set_aside],
            "live": settings.live_kind if item.session_uid in (*sessions.live, *sessions.live.paused) else "",
            "moved by": settings.moved_by,
            "handles": [(one.kind, one.empty and one.empty.name) for one in settings.handles],
            "results": [(one.kind, one.item and one.item.name) for one in settings.results],
            "carried": [one.item and one.item.name for one in settings.carried],
            "modifiers": [(one.name, one.type, one.show_viewport) for one in item.modifiers],
        }
    return found


def rest():
    """{name: digest of a mesh's own points, keys left out}."""
    meshes = {item.data for item in sources() if not settings_of(item).made_from}
    return {mesh.name_full: mesh_arrays.fingerprint(mesh) for mesh in meshes}


def dangling():
    """References of objects to data-blocks that are in no list of the file."""
    kinds = ("objects", "meshes", "curves", "lattices", "armatures", "node_groups", "materials", "actions")
    there = {one.as_pointer() for kind in kinds for one in getattr(bpy.data, kind)}
    found = []
    for item in list(bpy.data.objects):
        named = [("data", item.data), ("parent", item.parent)]
        for modifier in item.modifiers:
            named += [(f"{modifier.name}: {path}", value) for path, value in references.references(modifier)]
        named += pointers(settings_of(item))
        found += [(item.name, path) for path, value in named if value is not None and is_gone(value, there)]
    return found


def pointers(group):
    """[(path, data-block)] of all pointers in a group of settings, in its groups and lists."""
    found = []
    for one in group.bl_rna.properties:
        if one.type == "COLLECTION":
            found += [each for entry in getattr(group, one.identifier) for each in pointers(entry)]
        elif one.type == "POINTER" and one.identifier != "rna_type":
            value = getattr(group, one.identifier)
            if isinstance(value, bpy.types.PropertyGroup):
                found += pointers(value)
            elif value is not None:
                found.append((f"{group.path_from_id()}.{one.identifier}", value))
    return found


def is_gone(value, there):
    kinds = bpy.types.Object | bpy.types.Mesh | bpy.types.NodeTree | bpy.types.Curve | bpy.types.Lattice
    return isinstance(value, kinds) and value.as_pointer() not in there


# The scene of a walk of shapes (tests/fuzz/walk), and what is shown beside what the file says should be.

WAIT = 120  # seconds at most for a shape to settle; a busy machine needs them
SHORTLY = 1  # the same for one with secondary motion
NAMES = ("Bar", "Ball", "Shell")
FEW = {"coarse_centers": 10, "fine_centers": 40, "samples": 400}


def few_centers():
    """Solves take milliseconds, here and in what the walk compares them with; returns what ends that."""
    places = (frame_solver, "SAMPLES"), (user_preferences, "machine_options"), (frame_solver, "STYLE")
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


def build_shapes():
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


def shape_sources():
    """The objects of the walk that are in the scene, by name; a walk may rename them."""
    items = in_view(bpy.context)
    return [item for item in items if item.type == "MESH" and item.get("walks", item.name) in NAMES]


def strays():
    """Handles whose Empty is gone, or is not theirs."""
    return [
        (item.name, index, entry.empty and entry.empty.name)
        for item in shape_sources()
        for index, entry in enumerate(settings_of(item).handles)
        if entry.empty is None or owner_of(entry.empty) != item
    ]


def settle():
    """As the timer does, until every shape is as good as it gets. One that swings without damping never
    rests: it is waited for shortly."""
    for _ in range(5):
        before = dict(sessions.live)
        bpy.context.view_layer.update()
        sessions.update(bpy.context)
        waits = {uid: SHORTLY if one.has_motion else WAIT for uid, one in sessions.live.items()}
        if any([sessions.update_one(bpy.context, uid, wait, refined=True) for uid, wait in waits.items()]):
            references.push("Live")
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
    solver = FrameSolver(frame_solver.sampled(reader.setup), reader.carrying)
    return solver.solve_from_rest(reader.request(bpy.context)).points


def difference(shown, expected):
    """The largest distance as a share of the size."""
    if len(shown) != len(expected):
        return np.inf
    return float(np.linalg.norm(shown - expected, axis=1).max() / np.ptp(expected, axis=0).max())


def everything():
    """{name: (place, digest of what is seen)} of all objects, to be compared bit for bit."""
    found = {}
    for item in in_view(bpy.context):
        seen = hashlib.sha1(scenes.world_points(item).tobytes()).hexdigest() if item.type == "MESH" else ""
        found[item.name] = [round(x, 6) for row in item.matrix_world for x in row], seen
    return found
