# SPDX-License-Identifier: GPL-3.0-or-later
"""Empties as handles: rest boxes kept in the source's coordinates, motions read from where they are now."""

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..core.errors import UserError
from ..core.handles import box_matrix, solve_handle
from ..core.spaces import transform
from ..names import HANDLE_SUFFIX
from . import arrays, groups
from .lookup import settings_of


def matrix_of(item):
    return np.array(item.matrix_world, dtype=np.float64)


def box_now(empty):
    """The cube [-1, 1]³ → world, of an Empty where it is now."""
    return box_matrix(matrix_of(empty), empty.empty_display_size)


def rest_box(source, entry):
    """The cube [-1, 1]³ → world, of a handle's rest box; it goes where the source goes."""
    return matrix_of(source) @ np.array(entry.rest, dtype=np.float64).reshape(4, 4)


def store_rest(source, entry):
    """Makes where the handle's Empty is now its rest pose."""
    relative = np.linalg.inv(matrix_of(source)) @ box_now(entry.empty)
    entry.rest = relative.ravel()


def used(source):
    """The handles whose Empties still exist."""
    return [entry for entry in settings_of(source).handles if entry.empty is not None]


def find(source, empty):
    """Index of the Empty's handle in the source's list, or -1."""
    handles = settings_of(source).handles
    return next((index for index, entry in enumerate(handles) if entry.empty == empty), -1)


def solve_handles(context, source, space):
    """All handles of a source as the solver wants them; UserError when there is none."""
    found = []
    for entry in used(source):
        weights = groups.vertex_weights(context, source, entry.group) if entry.kind == "GROUP" else None
        where = rest_box(source, entry), box_now(entry.empty)
        further = {"weights": weights, "weight": entry.weight}
        found.append(solve_handle(entry.empty.name, entry.kind, *where, space, **further))
    if not found:
        raise UserError(f"{source.name} has no handle; add one in the panel's Handles section")
    return found


SHAPES = {"CUBE": "CUBE", "POINT": "SPHERE", "GROUP": "ARROWS"}


def add(source, empty, kind="CUBE"):
    """Turns an Empty into a handle of the source, at rest where it is; one it was already is only reset."""
    if empty.empty_display_type == "IMAGE":
        raise UserError(f"{empty.name} shows an image; take another kind of Empty")
    if abs(np.linalg.det(box_now(empty)[:3, :3])) == 0:
        raise UserError(f"{empty.name} is flat; give it a size and a scale other than zero")
    ours = settings_of(source)
    owner = settings_of(empty).handle_of
    if owner is not None and owner != source:
        remove(owner, find(owner, empty))
    index = find(source, empty)
    if index < 0:
        index = len(ours.handles)
        ours.handles.add()
    entry = ours.handles[index]
    entry.empty, entry.kind = empty, kind
    settings_of(empty).handle_of = source
    empty.empty_display_type = SHAPES[kind]
    store_rest(source, entry)
    ours.active_handle = index
    return entry


def make_empty(context, source, matrix, size):
    """A new cube Empty beside the source in its collection."""
    empty = bpy.data.objects.new(f"{source.name}{HANDLE_SUFFIX}", None)
    empty.empty_display_type, empty.empty_display_size = "CUBE", size
    home = next((c for c in source.users_collection if c in editable(context)), context.collection)
    home.objects.link(empty)
    empty.matrix_world = matrix
    context.view_layer.update()
    return empty


def editable(context):
    return [context.scene.collection, *context.scene.collection.children_recursive]


def new_empty(context, source, kind, group):
    """A new Empty a sixth of the source's size: at the 3D cursor, or amid the vertex group."""
    corners = transform(matrix_of(source), np.array(source.bound_box))
    size = float(np.ptp(corners, axis=0).max()) / 6 or 1.0
    place = context.scene.cursor.location
    if kind == "GROUP":
        weights = groups.vertex_weights(context, source, group)
        with arrays.evaluated_mesh(context, source) as mesh:
            middle = np.average(arrays.positions(mesh), axis=0, weights=weights)
        place = source.matrix_world @ Vector(middle)
    return make_empty(context, source, Matrix.Translation(place), size)


def reset(source, entry):
    """Moves a handle's Empty back to its rest pose."""
    size = entry.empty.empty_display_size or 1.0
    matrix = rest_box(source, entry) @ np.diag([1 / size, 1 / size, 1 / size, 1.0])
    entry.empty.matrix_world = Matrix(matrix.tolist())


def remove(source, index):
    """Takes a handle off the source's list; its Empty stays as an ordinary one."""
    ours = settings_of(source)
    empty = ours.handles[index].empty
    if empty is not None:
        settings_of(empty).handle_of = None
    ours.handles.remove(index)
    ours.active_handle = max(0, min(ours.active_handle, len(ours.handles) - 1))


def count_inside(context, source):
    """Stores how many of the shown vertices each handle holds at rest."""
    with arrays.evaluated_mesh(context, source) as mesh:
        vertices = arrays.positions(mesh)
    for entry in used(source):
        if entry.kind == "GROUP":
            held = groups.vertex_weights(context, source, entry.group) >= groups.HELD
        else:
            box = np.array(entry.rest, dtype=np.float64).reshape(4, 4)
            held = (np.abs((vertices - box[:3, 3]) @ np.linalg.inv(box[:3, :3]).T) <= 1).all(axis=1)
        entry.inside = int(held.sum()) if entry.kind != "POINT" else -1
