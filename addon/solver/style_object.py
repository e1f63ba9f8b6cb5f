# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh object as a style: its native ObjectStyle, cached by a fingerprint of mesh and matrix."""

import bmesh
import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import depsgraph_of
from ..core.errors import UserError
from ..core.runtime import native
from ..handles.empties import matrix_of

MOST_NORMALS = 64  # face normals of an object without a volume; with more it is no style
KEPT = 8  # size of the cache: objects, or orientations of one
cache = {}  # key → ObjectStyle or (k, 3) normals


def refusal(item):
    """UserError if an object cannot be a style, without reading its mesh; else None."""
    if item.type != "MESH":
        return UserError("{name} is no mesh; a mesh object is needed as a style", item)
    return None


def style_of(item, where=matrix_of):
    """(style, key): an ObjectStyle in the world's directions, or the (k, 3) face normals of an object without
    a volume; equal keys for equal styles. UserError that names the object if it gives neither."""
    reason = refusal(item)
    if reason is not None:
        raise reason
    linear = np.asarray(where(item), dtype=np.float64)[:3, :3]
    seen = item if modifier_stack.find(item) else item.evaluated_get(depsgraph_of(bpy.context))
    mesh = seen.to_mesh()
    try:
        key = mesh_arrays.fingerprint(mesh), linear.tobytes()
        if key not in cache:
            while len(cache) >= KEPT:
                del cache[next(iter(cache))]
            cache[key] = _read(item.name, mesh, linear)
        return cache[key], key
    finally:
        seen.to_mesh_clear()


def _read(name, mesh, linear):
    reason = mesh_arrays.nothing_in(name, len(mesh.vertices), len(mesh.polygons))
    if reason is not None:
        raise reason
    af = native.library()
    points, corners = mesh_arrays.positions(mesh) @ linear.T, mesh_arrays.triangles(mesh)
    for close in (False, True):
        if close:
            points, corners = _closed(points, corners)
        try:
            return af.ObjectStyle(points, corners)
        except af.InvalidInput:
            continue
    return _face_normals(name, mesh, linear)


def _closed(points, corners):
    """The mesh with coincident vertices merged and its holes filled."""
    points, which = np.unique(points, axis=0, return_inverse=True)
    closed = bmesh.new()
    vertices = [closed.verts.new(point) for point in points]
    for a, b, c in which.reshape(-1)[corners]:
        if len({a, b, c}) == 3 and not closed.faces.get((vertices[a], vertices[b], vertices[c])):
            closed.faces.new((vertices[a], vertices[b], vertices[c]))
    bmesh.ops.holes_fill(closed, edges=[edge for edge in closed.edges if edge.is_boundary], sides=0)
    bmesh.ops.recalc_face_normals(closed, faces=closed.faces)
    bmesh.ops.triangulate(closed, faces=closed.faces)
    closed.verts.index_update()
    points = np.array([vertex.co for vertex in closed.verts], dtype=np.float64).reshape(-1, 3)
    corners = np.array([[v.index for v in face.verts] for face in closed.faces], dtype=np.int64).reshape(
        -1, 3
    )
    closed.free()
    return points, corners


def _face_normals(name, mesh, linear):
    """(k, 3) distinct unit normals of the faces, in world space."""
    normals = np.empty(3 * len(mesh.polygons), dtype=np.float32)
    mesh.polygons.foreach_get("normal", normals)
    turned = normals.reshape(-1, 3).astype(np.float64) @ np.linalg.pinv(linear)  # by the inverse transpose
    turned = turned[np.linalg.norm(turned, axis=1) > 0]
    turned = np.unique(np.round(turned / np.linalg.norm(turned, axis=1, keepdims=True), 3), axis=0)
    if not 0 < len(turned) <= MOST_NORMALS:
        raise UserError(
            "{name} encloses no volume, and has {count} different face normals; a closed object, or from 1 "
            "to {most} normals, make a style",
            name=name,
            count=len(turned),
            most=MOST_NORMALS,
        )
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)
