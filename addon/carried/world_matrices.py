# SPDX-License-Identifier: GPL-3.0-or-later
"""World matrices of a carried object: now, and with the bones that are handles at rest.

An object parented to such a bone follows it already: the field moves it from the bone's rest pose, so that no
motion counts twice.
"""

from dataclasses import dataclass

import numpy as np
from mathutils import Matrix

from ..blender.evaluation import with_ancestors
from ..core.errors import UserError
from .rest_bones import resting

FOLLOWING = {"CHILD_OF", "COPY_LOCATION", "COPY_TRANSFORMS", "ARMATURE"}  # that place an object


@dataclass(frozen=True)
class WorldMatrices:
    """(4, 4) world matrices: of the object at rest and now, and of its parent now."""

    rest: np.ndarray
    now: np.ndarray
    parent: np.ndarray


def array(matrix):
    return np.array(matrix, dtype=np.float64)


def world_matrices(item, rigs, depsgraph, basis=None, under=()):
    """The object's WorldMatrices; `basis`: its own transform, if other than the present one.

    `under`: armatures that come after the field. An object parented to one of their bones is taken without
    the pose: `rest` by the rest bones before any fit, `now` by the present rest bones.
    """
    seen = item.evaluated_get(depsgraph)
    now, own = array(seen.matrix_world), array(seen.matrix_basis)
    if hangs_on(item, under):
        basis = own if basis is None else basis
        rest, parent = (unposed_parent(item, under, depsgraph, found) for found in (first_rest, present_rest))
        return WorldMatrices(rest @ basis, parent @ own, parent)
    parent = parent_now(item, depsgraph, now, own)
    if basis is None and not hangs_on(item, rigs):
        return WorldMatrices(now, now, parent)
    at_rest = parent_at_rest(item, rigs, depsgraph) if hangs_on(item, rigs) else parent
    return WorldMatrices(at_rest @ (own if basis is None else basis), now, parent)


def parent_now(item, depsgraph, now, own):
    """(4, 4) matrix from the object's own transform to the world."""
    if item.parent is None:
        return np.eye(4)
    is_flat = np.linalg.det(own[:3, :3]) == 0.0
    if not is_flat and not any(constraint.enabled for constraint in item.constraints):
        return now @ np.linalg.inv(own)
    return parent_of(item, depsgraph, array(item.parent.evaluated_get(depsgraph).matrix_world), posed=True)


def parent_at_rest(item, rigs, depsgraph):
    rest = world_matrices(item.parent, rigs, depsgraph).rest
    return parent_of(item, depsgraph, rest, posed=item.parent not in rigs)


def parent_of(item, depsgraph, world, posed):
    """(4, 4) the parent's part of an object's world matrix, for a parent at `world`."""
    inverse = array(item.matrix_parent_inverse)
    if item.parent_type == "OBJECT":
        return world @ inverse
    if item.parent_type != "BONE" or item.parent_bone not in item.parent.data.bones:
        raise UserError("{name} hangs on {parent} in a way that cannot be followed", **names(item))
    bone = item.parent.data.bones[item.parent_bone]
    pose = item.parent.evaluated_get(depsgraph).pose.bones[item.parent_bone].matrix
    tail = array(Matrix.Translation((0, bone.length, 0)))
    if bone.use_relative_parent:
        tail = np.linalg.inv(array(bone.matrix_local))
    return world @ array(pose if posed else bone.matrix_local) @ tail @ inverse


def unposed_parent(item, rigs, depsgraph, rest_of):
    """The same with these armatures unposed; `rest_of(rig, name)`: a bone's (4, 4) rest matrix and length."""
    parent, inverse = item.parent, array(item.matrix_parent_inverse)
    if not (parent in rigs and item.parent_type == "BONE"):
        own = array(parent.evaluated_get(depsgraph).matrix_basis)
        world = unposed_parent(parent, rigs, depsgraph, rest_of) @ own
        return parent_of(item, depsgraph, world, posed=True)
    if item.parent_bone not in parent.data.bones:
        raise UserError("{name} hangs on {parent} in a way that cannot be followed", **names(item))
    matrix, length = rest_of(parent, item.parent_bone)
    tail = array(Matrix.Translation((0, length, 0)))
    if parent.data.bones[item.parent_bone].use_relative_parent:
        tail = np.linalg.inv(matrix)
    return array(parent.evaluated_get(depsgraph).matrix_world) @ matrix @ tail @ inverse


def at_present_rest(item, depsgraph):
    """(4, 4) matrix from the own transform of an object parented to a bone to the world, without the pose."""
    return unposed_parent(item, (item.parent,), depsgraph, present_rest)


def first_rest(rig, name):
    """(4, 4) rest matrix and length of a bone before any fit."""
    bones, poses, lengths = resting(rig)
    index = bones.index(name)
    return poses[index], lengths[index]


def present_rest(rig, name):
    bone = rig.data.bones[name]
    return array(bone.matrix_local), bone.length


def names(item):
    return {"name": item.name, "parent": item.parent.name}


def hangs_on(item, rigs):
    """Whether an object or one of its ancestors is parented to a bone of one of these armatures."""
    return any(one.parent in rigs and one.parent_type == "BONE" for one in with_ancestors(item))


def constrained_to(item, rigs):
    """Whether constraints move the object by one of these armatures: inseparable from the field's motion."""
    return any(c.enabled and c.type in FOLLOWING and targets(c) & set(rigs) for c in item.constraints)


def targets(constraint):
    entries = getattr(constraint, "targets", [constraint])  # several, of an Armature constraint
    return {entry.target for entry in entries} - {None}
