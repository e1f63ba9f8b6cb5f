# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups on the surface: weights of samples from the nearest vertices of the mesh as shown."""

import bpy
import numpy as np
from mathutils.kdtree import KDTree

from ..core.errors import UserError
from ..core.geometry.handles import require_held
from . import mesh_arrays
from .object_references import ObjectId

BLOCK = 4000  # vertices that are read at once, some milliseconds


def read_weights(context, source, names):
    """Course (core/courses.py) that reads {name: (n,) weights of the shown vertices} of vertex groups."""
    names = list(dict.fromkeys(names))
    for name in names:
        if name not in source.vertex_groups:
            raise UserError("{name} has no vertex group {group}", name=source.name, group=name)
    if not names:
        return {}
    who, copied = ObjectId(source), None
    if any(modifier.show_viewport for modifier in source.modifiers):
        copied = mesh_arrays.shown_copy(context, source)
    try:
        return (yield from _read(who, copied, names))
    finally:
        if copied is not None:
            bpy.data.meshes.remove(copied)


def _read(who, copied, names):
    source = who.get()
    count = len((copied or source.data).vertices)
    found = {source.vertex_groups[name].index: np.zeros(count) for name in names}
    for begin in range(0, count, BLOCK):
        vertices = (copied or who.get().data).vertices
        if len(vertices) != count:
            raise UserError("{name} changed while it was worked on; run again", name=who.name)
        for index, vertex in enumerate(vertices[begin : begin + BLOCK], begin):
            for entry in vertex.groups:
                if entry.group in found:
                    found[entry.group][index] = entry.weight
        yield False
    weights = dict(zip(names, found.values(), strict=True))
    for name in names:
        if not weights[name].any():
            raise UserError("the vertex group {group} of {name} holds no vertex", group=name, name=who.name)
    return weights


def at_points(vertices, weights, points):
    """(p,) weights of points, each from its three nearest vertices by inverse distance."""
    tree = KDTree(len(vertices))
    for index, vertex in enumerate(vertices):
        tree.insert(vertex, index)
    tree.balance()
    near = [[(index, distance) for _, index, distance in tree.find_n(point, 3)] for point in points]
    indices, distances = np.moveaxis(np.array(near, dtype=np.float64), 2, 0)
    shares = 1.0 / np.maximum(distances, 1e-12)
    found = (shares * weights[indices.astype(np.int64)]).sum(axis=1) / shares.sum(axis=1)
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
