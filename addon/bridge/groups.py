# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups on the surface: weights of samples from the nearest vertices of the mesh as shown."""

import numpy as np
from mathutils.kdtree import KDTree

from ..core.errors import UserError
from ..core.handles import require_held
from . import arrays


def vertex_weights(context, source, name):
    """(n,) weights of the shown vertices in the object's vertex group of that name."""
    group = source.vertex_groups.get(name)
    if group is None:
        raise UserError("{name} has no vertex group {group}", name=source.name, group=name)
    with arrays.evaluated_mesh(context, source) as mesh:
        weights = np.zeros(len(mesh.vertices))
        for vertex in mesh.vertices:
            for entry in vertex.groups:
                if entry.group == group.index:
                    weights[vertex.index] = entry.weight
    if not weights.any():
        raise UserError("the vertex group {group} of {name} holds no vertex", group=name, name=source.name)
    return weights


def at_points(vertices, weights, points):
    """(p,) weights of points, each from its three nearest vertices by inverse distance."""
    tree = KDTree(len(vertices))
    for index, vertex in enumerate(vertices):
        tree.insert(vertex, index)
    tree.balance()
    found = np.empty(len(points))
    for row, point in enumerate(points):
        near = tree.find_n(point, 3)
        shares = np.array([1.0 / max(distance, 1e-12) for _, _, distance in near])
        found[row] = shares @ weights[[index for _, index, _ in near]] / shares.sum()
    return np.clip(found, 0.0, 1.0)


HELD = 0.5  # weight from which a vertex group's handle holds a sample


def native_handles(af, wanted, rest, samples):
    """Handles for the native solver; UserError that names those without a sample. Runs on the worker."""
    counts, ready = {}, []
    for handle in wanted:
        if handle.kind == "POINT":
            ready.append(af.Point(handle.rest[:3, 3], handle.target[:3, 3], weight=handle.weight))
        elif handle.kind == "GROUP":
            held = np.flatnonzero(at_points(rest.vertices, handle.weights, samples.points) >= HELD)
            counts[handle.name] = len(held)
            ready.append(af.Region(held.tolist(), handle.rest, handle.target, weight=handle.weight))
        else:
            counts[handle.name] = int(handle.inside(samples.points).sum())
            ready.append(af.Cuboid(handle.rest, handle.target, weight=handle.weight))
    require_held(counts)
    return ready
