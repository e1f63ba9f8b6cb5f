# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes at rest to skin, in the armature's coordinates, and the weights of their vertex groups."""

from dataclasses import dataclass

import numpy as np
from mathutils.kdtree import KDTree

from ..blender import mesh_arrays, modifier_stack, vertex_groups
from ..blender.object_references import ObjectReference
from ..core.errors import UserError, refuse
from ..core.geometry.spaces import facing, inverse, is_in_place, space_of, transform
from ..handles.movers import matrix_of
from ..stiffness import painted


@dataclass
class Shape:
    """One mesh object; its shape is the input of its Armature modifier, present or future."""

    reference: ObjectReference
    arrays: mesh_arrays.MeshArrays
    vertices: np.ndarray  # (n, 3) in the armature's coordinates
    triangles: np.ndarray
    to_rig: np.ndarray  # (4, 4) object's → armature's coordinates
    nearest: np.ndarray | None  # (own vertices,) index into `vertices`; None if these are the mesh's own
    kept: dict  # {bone: (own vertices,) weights to keep}
    stiffness: tuple  # (n,) factors of stiffness, of bending stiffness; each None if all are 1
    mark: tuple

    def own(self, weights):
        """The rows of the mesh's own vertices."""
        return weights if self.nearest is None else weights[self.nearest]

    def get(self, rig):
        """The object; UserError if its mesh, or its placement relative to the armature, has changed."""
        item = self.reference.get()
        is_there = is_in_place(transform(to_armature(item, rig), self.arrays.vertices), self.vertices)
        if mesh_arrays.fingerprint(item.data) != self.mark or not is_there:
            raise UserError("{name} changed while it was worked on; run again", item)
        return item


def place(item, rig):
    """Index of the Armature modifier in the object's stack, or the index to insert it at."""
    stack = list(item.modifiers)
    found = next((k for k, m in enumerate(stack) if m.type == "ARMATURE" and m.object == rig), None)
    if found is not None:
        return found
    end = len(stack)
    while end and modifier_stack.follows_field(stack[end - 1]):
        end -= 1
    return end


def read(context, item, rig, groups):
    """The Shape of an object while the armature is at rest; UserError if there is nothing to skin."""
    refuse(painted.refusal(item))
    to_rig = to_armature(item, rig)
    before = [m for m in list(item.modifiers)[: place(item, rig)] if m.show_viewport]
    with modifier_stack.mesh_of(context, item, before) as mesh:
        arrays = mesh_arrays.arrays_of(item, mesh)
        refuse(mesh_arrays.flat(item.name, arrays.vertices, arrays.triangles))
        painted_groups = {name: item.vertex_groups[name].index for name in painted.names(item)}
        stiffness = painted.of_weights(item, vertex_groups.weights_in(mesh, painted_groups))
    own = mesh_arrays.positions(item.data)
    keeps = all(map(modifier_stack.kind_keeps_vertices, before)) and len(own) == len(arrays.vertices)
    return Shape(
        ObjectReference(item),
        arrays,
        transform(to_rig, arrays.vertices),
        facing(arrays.triangles, to_rig),
        to_rig,
        None if keeps else nearest(arrays.vertices, own),
        kept_weights(item, rig, groups),
        stiffness,
        mesh_arrays.fingerprint(item.data),
    )


def to_armature(item, rig):
    """(4, 4) from an object's coordinates into the armature's; UserError if either matrix is singular."""
    for one in (item, rig):
        space_of(matrix_of(one), one.name)
    return inverse(matrix_of(rig)) @ matrix_of(item)


def nearest(vertices, points):
    """(p,) index of the vertex, of (n, 3), that is nearest to each point."""
    tree = KDTree(len(vertices))
    for index, vertex in enumerate(vertices):
        tree.insert(vertex, index)
    tree.balance()
    return np.array([tree.find(point)[1] for point in points])


def kept_weights(item, rig, groups):
    """{bone: (own vertices,) weights} of the groups that stay: locked ones, and with `groups` KEEP all that
    are not empty."""
    deforming = {bone.name for bone in rig.data.bones if bone.use_deform}
    own = [group for group in item.vertex_groups if group.name in deforming]
    locked = {group.name for group in own if group.lock_weight}
    found = vertex_groups.weights_in(item.data, {group.name: group.index for group in own})
    return {
        name: weights
        for name, weights in found.items()
        if name in locked or (groups == "KEEP" and weights.any())
    }


def fill_up(weights, kept, names, influences, points):
    """(n, bones) weights: the kept columns stay, the others are scaled to a sum of 1 with them. Of the (n, 3)
    points, one without weights gets those of the nearest point that has some."""
    if not kept:
        return weights
    fixed = [names.index(bone) for bone in kept]
    result = weights.copy()
    result[:, fixed] = 0.0
    held = np.stack(list(kept.values()), axis=1)
    room = np.clip(influences - (held > 0).sum(axis=1), 1, influences)
    order = np.argsort(np.argsort(-result, axis=1, kind="stable"), axis=1)
    result[order >= room[:, None]] = 0.0
    bare, others = ~(result.any(axis=1) | held.any(axis=1)), np.flatnonzero(result.any(axis=1))
    if bare.any() and len(others):
        result[bare] = result[others[nearest(points[others], points[bare])]]
    total, left = result.sum(axis=1), np.clip(1.0 - held.sum(axis=1), 0.0, 1.0)
    result *= (left / np.where(total > 0, total, 1.0))[:, None]
    result[:, fixed] = held
    return result


def join(shapes):
    """((n, 3) vertices, (m, 3) triangles, index of each shape's first vertex) of all shapes as one mesh."""
    firsts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
    rows = [shape.triangles + first for shape, first in zip(shapes, firsts, strict=False)]
    return np.concatenate([shape.vertices for shape in shapes]), np.concatenate(rows), firsts


def joined_stiffness(shapes):
    """[(n,) factors of stiffness, of bending stiffness] of all shapes as one mesh; None for ones."""
    joined = []
    for parts in zip(*(shape.stiffness for shape in shapes), strict=True):
        ones = [np.ones(len(shape.vertices)) for shape in shapes]
        filled = [one if part is None else part for one, part in zip(ones, parts, strict=True)]
        joined.append(None if all(part is None for part in parts) else np.concatenate(filled))
    return joined
