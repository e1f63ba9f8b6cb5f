# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps a point on the deformed surface to the rest shape, with the surface's rotation there.

The field's modifier only moves points, so that the faces before and after it are the same.
"""

from dataclasses import dataclass

import numpy as np
from mathutils import Vector
from mathutils.geometry import barycentric_transform, closest_point_on_tri

from ..blender import mesh_arrays, modifier_stack, point_data
from ..core.errors import UserError
from ..core.geometry.edges import connected
from ..core.geometry.spaces import best_rotation, transform
from ..handles.empties import matrix_of

CANDIDATES = 64  # number of triangles to search if the face is unknown
LEAST = 12  # least number of points to measure the rotation
LEAST_OWN = 3  # vertices that tell how a place turns


@dataclass(frozen=True)
class Place:
    rest: np.ndarray  # (3,) in world space, of the shape before the field
    now: np.ndarray  # (3,) in world space, after the field
    turn: np.ndarray  # (3, 3) rotation of the surface there since rest
    size: float  # of the shape at rest, in the object's units
    weights: dict  # {vertex group: mean weight of the points around it}


def find(context, source, location, radius, face=None, face_count=None):
    """The Place at a location on the shown surface, or of the splat nearest to it, (3,) in world space.

    `face` is that of the shown mesh, which has `face_count` of them: where the mesh before the field has as
    many, the place is looked for in that face alone.
    """
    world, rest = matrix_of(source), None
    if modifier_stack.find(source) is not None:
        with modifier_stack.evaluated_mesh(context, source, in_place=True) as still:
            rest = transform(world, mesh_arrays.positions(still))
    with modifier_stack.moved_mesh(context, source) as mesh:
        now = transform(world, mesh_arrays.positions(mesh))
        rest = now if rest is None else rest
        faces = point_data.face_count(mesh)
        if not len(now):
            raise UserError("{name} has no vertices to hold a pin", source)
        if not faces:
            nearest = int(((now - location) ** 2).sum(axis=1).argmin())
            at_rest, moved = rest[nearest], now[nearest]
        else:
            if face is not None and face_count == faces:
                chosen = mesh_arrays.triangles_of(mesh, face)
            else:
                chosen = near(now, mesh_arrays.triangles(mesh), location)
            at_rest, moved = map_back(now, rest, chosen, location)
        about = around(rest, at_rest, radius)
        if faces:
            scale = 1 / max(radius, np.linalg.norm(rest[about] - at_rest, axis=1).max(), 1e-300)
            ball = scale * (rest - at_rest)
            own = connected(ball[about], ball, mesh_arrays.triangles(mesh))
            about = about[own] if own.sum() >= LEAST_OWN else about
        weights = group_weights(source, mesh, about)
    size = float(np.linalg.norm(np.ptp(rest, axis=0)) / np.cbrt(abs(np.linalg.det(world[:3, :3])) or 1.0))
    return Place(at_rest, moved, best_rotation(rest[about], now[about]), size, weights)


def near(points, triangles, location):
    """The CANDIDATES triangles whose centers are nearest to the location."""
    away = ((points[triangles].mean(axis=1) - location) ** 2).sum(axis=1)
    count = min(CANDIDATES, len(away))
    return triangles[np.argpartition(away, count - 1)[:count]]


def map_back(now, rest, triangles, location):
    """((3,) rest position, (3,) position) of the point on these triangles nearest to the location."""
    best, nearest, triangle = np.inf, Vector(location), triangles[0]
    for corners in triangles:
        point = closest_point_on_tri(Vector(location), *(Vector(now[i]) for i in corners))
        away = (point - Vector(location)).length
        if away < best:
            best, nearest, triangle = away, point, corners
    ends = [Vector(now[i]) for i in triangle], [Vector(rest[i]) for i in triangle]
    mapped = np.array(barycentric_transform(nearest, *ends[0], *ends[1]))
    if not np.isfinite(mapped).all():  # a degenerate triangle
        closest = triangle[np.linalg.norm(now[triangle] - nearest, axis=1).argmin()]
        mapped = rest[closest]
    return mapped, np.array(nearest)


def around(rest, place, radius):
    """Indices of the points within the radius, or of the LEAST nearest ones if these are fewer."""
    away = np.linalg.norm(rest - place, axis=1)
    count = max(int((away <= radius).sum()), min(LEAST, len(rest)))
    return np.argpartition(away, count - 1)[:count]


def group_weights(source, mesh, indices):
    """{vertex group: mean weight of these points of the mesh}."""
    names = {group.index: group.name for group in source.vertex_groups}
    sums = dict.fromkeys(names.values(), 0.0)
    for index in indices.tolist() if names else ():
        for entry in mesh.vertices[index].groups:
            if entry.group in names:
                sums[names[entry.group]] += entry.weight / len(indices)
    return sums
