# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks: pairs of Empties, parented to the source at rest and to the target."""

import re

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import mesh_arrays, modifier_stack
from ..blender.object_references import ObjectReference, in_scene, settings_of
from ..core.errors import UserError, refuse
from ..core.geometry.spaces import facing, inverse, transform
from ..field_modifier import layers
from ..handles.empties import delete, free_colour, make_empty, matrix_of
from ..pin_tool import pins
from ..results import placement

MOST_KNOWN = 1000  # places whose nearest vertices are remembered
SIZE = 0.02  # of an Empty, as a share of the object's diagonal


def target_of(source, name=""):
    """The object that a source is wrapped onto; UserError without a suitable one."""
    target = bpy.data.objects.get(name) if name else settings_of(source).wrap.onto
    if name and target is None:
        raise UserError("There is no object {name}", name=name)
    if not in_scene(target):
        raise UserError("Choose the object to wrap {name} onto", source)
    if target.type != "MESH" or target == source:
        raise UserError("{name} is no other mesh object to wrap onto", target)
    return target


def read_target(context, target, space):
    """(n, 3) vertices and (m, 3) triangles of the evaluated target, in solve space."""
    mesh = mesh_arrays.read(context, target)
    refuse(mesh_arrays.nothing_in(target.name, len(mesh.vertices), len(mesh.triangles)))
    to_solve = space.world_to_solve @ matrix_of(target)
    vertices = transform(to_solve, mesh.vertices)
    refuse(mesh_arrays.flat(target.name, vertices, mesh.triangles))
    return vertices, facing(mesh.triangles, to_solve)


def refusal(source):
    """UserError that says why a source has no target; else None."""
    try:
        target_of(source)
    except UserError as error:
        return error
    return None


def used(source):
    """The entries with both Empties in a scene."""
    return [e for e in settings_of(source).wrap.landmarks if in_scene(e.rest) and in_scene(e.on_target)]


def world_vertices_at_rest(context, source):
    """(n, 3) world vertices of the shape before the field."""
    return transform(matrix_of(source), mesh_arrays.read(context, source, in_place=True).vertices)


def read(source, space, seen=None, rest=None):
    """[(rest, on_target)] in solve space, (3,) each.

    `seen` and `rest`, (n, 3) in the world: the posed shape that the landmarks were put on, and the unposed
    one to wrap. A landmark moves by the difference at its nearest vertex.
    """
    pairs = []
    is_posed = seen is not None and len(seen) == len(rest) and not np.array_equal(seen, rest)
    for entry in used(source):
        ends = [matrix_of(item)[:3, 3] for item in (entry.rest, entry.on_target)]
        if is_posed:
            nearest = ((seen - ends[0]) ** 2).sum(axis=1).argmin()
            ends[0] = ends[0] + rest[nearest] - seen[nearest]
        pairs.append(tuple(transform(space.world_to_solve, end[None])[0] for end in ends))
    return pairs


def place(context, source, target, rest, on_target):
    """Adds a pair at the surface points nearest to two world locations, (3,) each."""
    at_rest = pins.find(context, source, rest, 0.0).rest
    return add(context, source, target, (at_rest, pins.find(context, target, on_target, 0.0).now))


def add(context, source, target, pair):
    """Adds a pair at these world locations: on the source at rest, on the target."""
    placement.show_landmarks(source, True)
    number = len(settings_of(source).wrap.landmarks) + 1
    ends = [
        empty_at(context, source, pair[0], f"Landmark {number}"),
        empty_at(context, target, pair[1], f"Landmark {number} {target.name}"),
    ]
    wrap = settings_of(source).wrap
    colour = free_colour(wrap.landmarks)
    entry = wrap.landmarks.add()
    entry.rest, entry.on_target = ends
    entry.colour = colour
    return entry


def empty_at(context, owner, where, name):
    """A new Empty at a world location, parented to its owner."""
    world = matrix_of(owner)
    corners = transform(world, np.array(owner.bound_box))
    size = SIZE * float(np.linalg.norm(np.ptp(corners, axis=0))) or 1.0
    empty = make_empty(context, owner, Matrix.Translation(where.tolist()), size, name)
    empty.empty_display_type, empty.show_in_front = "SPHERE", True
    return empty


def shown_place(source, place):
    """(3,) where the shown surface of a source has a place of its surface at rest, both in the world."""
    place, world = np.array(place, dtype=np.float64), matrix_of(source)
    if modifier_stack.top(source) is None or source.mode == "EDIT":
        return place
    local = transform(inverse(world), place[None])[0]
    return place + world[:3, :3] @ layers.offset_at(source, nearest_vertex(source, local))


# Vertices by (session_uid of the object, number of vertices, place): views are drawn again and again.
nearest = {}


def nearest_vertex(source, local):
    """The index of a mesh's vertex nearest to a place, in local coordinates."""
    key = source.session_uid, len(source.data.vertices), tuple(local.round(6).tolist())
    if key not in nearest:
        if len(nearest) > MOST_KNOWN:
            nearest.clear()
        away = ((mesh_arrays.positions(source.data) - local) ** 2).sum(axis=1)
        nearest[key] = int(away.argmin())
    return nearest[key]


def mirror(context, source):
    """Mirrors the pairs across both objects' X axes, except those with a pair there; returns their number."""
    target, flip = target_of(source), np.diag([-1.0, 1.0, 1.0, 1.0])
    worlds = [matrix_of(source), matrix_of(target)]
    pairs = [[matrix_of(item)[:3, 3] for item in (e.rest, e.on_target)] for e in used(source)]
    near = SIZE * np.linalg.norm(np.ptp(transform(worlds[0], np.array(source.bound_box)), axis=0))
    made = 0
    for pair in list(pairs):
        others = [transform(w @ flip @ inverse(w), p[None])[0] for w, p in zip(worlds, pair, strict=True)]
        if all(np.linalg.norm(others[0] - rest) > near for rest, _ in pairs):
            place(context, source, target, *others)
            pairs.append(others)
            made += 1
    return made


def remove(source, index):
    """Removes a pair with its Empties."""
    entries = settings_of(source).wrap.landmarks
    for item in (entries[index].rest, entries[index].on_target):
        if item is not None:
            delete(item)
    entries.remove(index)


class Marks:
    """The rows of the list of landmarks that a wrap leaves out."""

    def __init__(self, source):
        entries = list(settings_of(source).wrap.landmarks)
        self.source, self.left_out = ObjectReference(source), ()
        self.rows = [entries.index(entry) for entry in used(source)]

    def numbered(self, text):
        """Replaces "landmarks[i]" in a text by the number in the list."""
        return re.sub(r"landmarks\[(\d+)\]", lambda match: f"#{self.rows[int(match[1])] + 1}", text)

    def put(self):
        chosen = {self.rows[index] for index in self.left_out}
        for row, entry in enumerate(settings_of(self.source.get()).wrap.landmarks):
            entry.left_out = row in chosen
