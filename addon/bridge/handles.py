# SPDX-License-Identifier: GPL-3.0-or-later
"""Empties as handles: rest boxes kept in the source's coordinates, motions read from where they are now."""

import bpy
import numpy as np
from mathutils import Matrix

from ..core.errors import UserError
from ..core.handles import box_matrix, solve_handle
from ..names import HANDLE_SUFFIX
from . import arrays
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


def solve_handles(source, space):
    """All handles of a source as the solver wants them; UserError when there is none."""
    handles = [
        solve_handle(entry.empty.name, entry.kind, rest_box(source, entry), box_now(entry.empty), space)
        for entry in used(source)
    ]
    if not handles:
        raise UserError(f"{source.name} has no handle; add one in the panel's Handles section")
    return handles


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
    empty.empty_display_type = "CUBE" if kind == "CUBE" else "SPHERE"
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


def at_cursor(context, source):
    """A new Empty at the 3D cursor, a sixth of the source's size."""
    size = max(source.dimensions) / 6
    cursor = context.scene.cursor
    return make_empty(context, source, Matrix.Translation(cursor.location), size or 1.0)


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
    """Stores how many of the shown vertices lie in each handle's rest box."""
    with arrays.evaluated_mesh(context, source) as mesh:
        vertices = arrays.positions(mesh)
    for entry in used(source):
        box = np.array(entry.rest, dtype=np.float64).reshape(4, 4)
        local = (vertices - box[:3, 3]) @ np.linalg.inv(box[:3, :3]).T
        entry.inside = int((np.abs(local) <= 1).all(axis=1).sum())
