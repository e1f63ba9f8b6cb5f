# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex group weights, read in small steps, and interpolated at samples from the nearest vertices."""

import bpy
import numpy as np
from mathutils.kdtree import KDTree

from ..core.errors import UserError, refuse
from ..core.runtime.jobs import Pause
from . import modifier_stack
from .object_references import ObjectReference

BLOCK = 4000  # vertices read per step, which takes some milliseconds


def missing(source, names):
    """UserError if a source lacks one of these groups; else None."""
    name = next((name for name in names if name not in source.vertex_groups), None)
    if name is None:
        return None
    return (
        UserError("{name} has no vertex group {group}", source, group=name) if name else none_chosen(source)
    )


def none_chosen(source):
    """The UserError where a vertex group is needed and none was chosen."""
    if source.vertex_groups:
        return UserError("{name}: choose a vertex group", source)
    return UserError("{name} has no vertex group", source)


def active_name(source):
    """Name of the active vertex group, or ""; after Blender's Join there may be groups and none active."""
    active = source.vertex_groups.active
    return active.name if active is not None else ""


def read_weights(context, source, names, in_place=False):
    """Coroutine that reads the vertex groups with these names: {name: (n,) weights of the vertices}."""
    names = list(dict.fromkeys(names))
    refuse(missing(source, names))
    if not names:
        return {}
    reference, shown = ObjectReference(source), None
    if modifier_stack.shown_before(source, in_place):
        shown = modifier_stack.mesh_copy(context, source, in_place)
    try:
        return (yield from _read(reference, shown, names))
    finally:
        if shown is not None:
            bpy.data.meshes.remove(shown)


def _read(reference, shown, names):
    source = reference.get()
    count = len((shown or source.data).vertices)
    weights = {source.vertex_groups[name].index: np.zeros(count) for name in names}
    for begin in range(0, count, BLOCK):
        vertices = (shown or reference.get().data).vertices
        if len(vertices) != count:
            raise UserError("{name} changed while it was worked on; run again", reference)
        for index, vertex in enumerate(vertices[begin : begin + BLOCK], begin):
            for entry in vertex.groups:
                if entry.group in weights:
                    weights[entry.group][index] = entry.weight
        yield Pause.REDRAW
    weights = dict(zip(names, weights.values(), strict=True))
    for name in names:
        if not weights[name].any():
            raise UserError("The vertex group {group} of {name} holds no vertex", reference, group=name)
    return weights


def weights_in(mesh, groups):
    """{name: (n,) weights of a mesh's vertices} of the groups {name: index}."""
    weights = {index: np.zeros(len(mesh.vertices)) for index in groups.values()}
    for number, vertex in enumerate(mesh.vertices if groups else ()):
        for entry in vertex.groups:
            if entry.group in weights:
                weights[entry.group][number] = entry.weight
    return {name: weights[index] for name, index in groups.items()}


def put(item, name, weights):
    """Writes (n,) weights to the object's group of this name, new if missing; 0 removes a vertex."""
    group = item.vertex_groups.get(name) or item.vertex_groups.new(name=name)
    group.remove(range(len(weights)))
    for index in np.flatnonzero(weights).tolist():
        group.add((index,), float(weights[index]), "REPLACE")


def at_points(vertices, weights, points):
    """(p,) weights of points, each from its three nearest vertices by inverse distance."""
    return NearestVertices(vertices, points)(weights)


class NearestVertices:
    """Interpolates (n,) vertex values at points, each from its three nearest vertices by inverse distance."""

    def __init__(self, vertices, points):
        tree = KDTree(len(vertices))
        for index, vertex in enumerate(vertices):
            tree.insert(vertex, index)
        tree.balance()
        near = [[(index, distance) for _, index, distance in tree.find_n(point, 3)] for point in points]
        indices, distances = np.moveaxis(np.array(near, dtype=np.float64), 2, 0)
        self.indices, self.shares = indices.astype(np.int64), 1.0 / np.maximum(distances, 1e-12)

    def __call__(self, weights):
        return np.clip(self.blend(weights), 0.0, 1.0)

    def blend(self, values):
        """(p,) interpolated values of any (n,) vertex values."""
        return (self.shares * values[self.indices]).sum(axis=1) / self.shares.sum(axis=1)
