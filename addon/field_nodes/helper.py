# SPDX-License-Identifier: GPL-3.0-or-later
"""The helper of the node group: a mesh in no scene whose vertices are the numbers of a radial field.

It is a child of the object that the field deforms, and its space is the field's cube: the field stands where
that object stands.
"""

import bpy
import numpy as np
from mathutils import Matrix

from ..blender.object_references import ObjectReference, settings_of
from ..core.errors import UserError
from ..core.geometry.spaces import inverse
from ..core.runtime import native
from ..names import FIELD_SUFFIX
from .node_group import AFFINE, FRAME, INSIDE, KERNEL, MAP, MOVE, NODE, PART, PLACE, SCALE


def rows_of(field, local_to_solve, strength=1.0):
    """(n, 27) single precision, a row for each number of columns: part, place, scale, move, inside, map."""
    if not isinstance(field, native.library().RadialField):
        raise UserError("Nodes know the method Fast alone, without Exact Handles or a wrap")
    arrays = field.arrays()
    affine = strength * (arrays["affine"] - np.eye(4, 3, -1))
    scale, inside = -1.0 / (6.0 * arrays["radii"] ** 2), arrays.get("embedded", 0.0)
    moves = strength * arrays["coefficients"]
    kernels = rows(KERNEL, arrays["centers"], scale, moves, inside)
    parts = [
        rows(FRAME, np.zeros((1, 3)), map=columns_of(matrix_of(field, local_to_solve))),
        rows(AFFINE, np.zeros((1, 3)), map=affine_map(affine[1:].T, affine[0])),
        kernels[np.argsort(-np.abs(moves).max(axis=1), kind="stable")],  # so sums round least
    ]
    if "nodes" in arrays:
        slopes = arrays["slopes"].reshape(-1, 3, 3)
        values = arrays["values"] - np.einsum("nki,ni->nk", slopes, arrays["nodes"])
        scale = 1.0 / arrays["width"] ** 2
        parts.append(rows(NODE, arrays["nodes"], scale, map=affine_map(slopes, values)))
    if "places" in arrays:
        inside = arrays.get("embedded_places", 0.0)
        parts.append(rows(PLACE, arrays["places"], 1.0 / arrays["reaches"] ** 2, inside=inside))
    return np.concatenate(parts)


ATTRIBUTES = {  # of the helper's vertices: type, name of a value, columns of the rows
    PART: ("INT", "value", slice(0, 1)),
    "position": ("FLOAT_VECTOR", "vector", slice(1, 4)),
    SCALE: ("FLOAT", "value", slice(4, 5)),
    MOVE: ("FLOAT_VECTOR", "vector", slice(5, 8)),
    INSIDE: ("FLOAT_VECTOR", "vector", slice(8, 11)),
    MAP: ("FLOAT4X4", "value", slice(11, 27)),
}


def rows(part, places, scale=0.0, move=0.0, inside=0.0, map=0.0):
    """Rows of one part."""
    result = np.zeros((len(places), 27), dtype=np.float32)
    result[:, 0], result[:, 1:4], result[:, 4] = part, places, scale
    result[:, 5:8], result[:, 8:11], result[:, 11:] = move, inside, map
    return result


def affine_map(linear, constant):
    """(…, 16) x ↦ linear · x + constant."""
    matrix = np.zeros((*np.shape(linear)[:-2], 4, 4))
    matrix[..., :3, :3], matrix[..., :3, 3], matrix[..., 3, 3] = linear, constant, 1.0
    return columns_of(matrix)


def columns_of(matrix):
    """(…, 16) one column of the matrix after the other, as Blender stores it."""
    return np.swapaxes(matrix, -1, -2).reshape(*np.shape(matrix)[:-2], 16)


def matrix_of(field, local_to_solve):
    """(4, 4) the field's unit cube → local coordinates of its source."""
    to_solve = np.diag([*[field.frame.scale] * 3, 1.0])
    to_solve[:3, 3] = field.frame.center
    return inverse(local_to_solve) @ to_solve


def of(source):
    """The source's own helper, or None; a duplicate's property points to the original's helper."""
    helper = settings_of(source).field_helper
    return helper if helper is not None and helper.parent == source and helper.library is None else None


def make(source):
    mesh = bpy.data.meshes.new(f"{source.name}{FIELD_SUFFIX}")
    helper = bpy.data.objects.new(mesh.name, mesh)
    helper.parent, settings_of(source).field_helper = source, helper
    return helper


def write(helper, values):
    """Puts a field's rows on its helper; none: it moves nothing."""
    mesh = helper.data
    if len(mesh.vertices) != len(values):
        mesh.clear_geometry()
        mesh.vertices.add(len(values))
    for name, (kind, key, columns) in ATTRIBUTES.items():
        attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, "POINT")
        part = np.ascontiguousarray(values[:, columns], dtype=np.int32 if kind == "INT" else np.float32)
        attribute.data.foreach_set(key, part.ravel())
    for row in values[values[:, 0] == FRAME]:
        helper.matrix_parent_inverse = Matrix(row[ATTRIBUTES[MAP][2]].reshape(4, 4)).transposed()
    mesh.update()
    mesh.update_tag()
    helper.update_tag()


def read(helper):
    """The rows as write() takes them."""
    mesh = helper.data
    values = np.zeros((len(mesh.vertices), 27), dtype=np.float32)
    for name, (kind, key, columns) in ATTRIBUTES.items():
        if name in mesh.attributes:
            part = np.empty(values[:, columns].size, dtype=np.int32 if kind == "INT" else np.float32)
            mesh.attributes[name].data.foreach_get(key, part)
            values[:, columns] = part.reshape(values[:, columns].shape)
    return values


def clear(source):
    """Empties the source's helper, so that followers do not move."""
    if of(source) is not None:
        write(of(source), np.zeros((0, 27)))


class Follower:
    """The helper of a source during a run, in the place of a carried object."""

    def __init__(self, source):
        self.reference, self.uid = ObjectReference(of(source)), of(source).session_uid

    def read(self):
        return read(self.reference.find())

    def write(self, values):
        helper = self.reference.find()
        if helper is not None:
            write(helper, values)
