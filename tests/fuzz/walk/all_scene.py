# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of a walk of everything, and what must be as it was after undo and load."""

import hashlib

import bpy
import numpy as np
from support.blender import scenes

from addon.blender import mesh_arrays, references
from addon.blender.evaluation import is_disabled
from addon.blender.object_references import settings_of
from addon.live import sessions
from tests.blender.walk import world

SMALL = {  # settings of each object, so that solves take milliseconds
    "deform": {"iterations": 4, "samples": 300},
    "stylize": {"iterations": 4, "samples": 300},
    "wrap": {"samples": 300, "centers": 20, "stages": 1, "iterations": 2},
    "fit": {"iterations": 8, "width": 8, "layers": 2, "near_points": 300, "uniform_points": 100},
    "bake": {"range": "CUSTOM", "start": 1, "end": 2},
}
POINTED = ("MESH", "CURVE", "CURVES", "LATTICE", "SURFACE", "POINTCLOUD")


def small(item):
    settings = settings_of(item)
    for group, values in SMALL.items():
        for name, value in values.items():
            if hasattr(getattr(settings, group), name):
                setattr(getattr(settings, group), name, value)
    settings.resolution = 12


def begin_file():
    world.empty_file()
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
    return [item for item in bpy.context.view_layer.objects if item.type == "MESH"]


def picture():
    """{full name: what is seen of an object of this file and said of it}, to be compared exactly."""
    found = {}
    for item in bpy.context.view_layer.objects:
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
    for item in bpy.data.objects:
        named = [("data", item.data), ("parent", item.parent)]
        for modifier in item.modifiers:
            named += [(f"{modifier.name}: {path}", value) for path, value in references.references(modifier)]
        settings = settings_of(item)
        for group in (settings.handles, settings.results, settings.carried):
            named += [
                (one.path_from_id(), getattr(one, "empty", getattr(one, "item", None))) for one in group
            ]
        found += [(item.name, path) for path, value in named if value is not None and is_gone(value, there)]
    return found


def is_gone(value, there):
    kinds = bpy.types.Object | bpy.types.Mesh | bpy.types.NodeTree | bpy.types.Curve | bpy.types.Lattice
    return isinstance(value, kinds) and value.as_pointer() not in there
