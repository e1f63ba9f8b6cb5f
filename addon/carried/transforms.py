# SPDX-License-Identifier: GPL-3.0-or-later
"""Carried objects that move as a whole: their world matrices, and the motions that the field gives them."""

import json
from dataclasses import dataclass

import numpy as np
from mathutils import Euler, Matrix, Quaternion, Vector

from ..blender.evaluation import remove_curves, with_ancestors
from ..core.errors import UserError
from ..core.geometry import spaces
from ..core.geometry.spaces import inverse, transform, unflattened
from ..field_modifier import motion
from .carriers import Carrier
from .rest_bones import resting

# World matrices of a carried object: now, and with the bones that are handles at rest.
#
# An object parented to such a bone follows it already: the field moves it from the bone's rest pose, so
# that no motion counts twice.

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
    is_free = not is_flat and not any(constraint.enabled for constraint in item.constraints)
    if is_free and not is_plain(item):
        return now @ np.linalg.inv(own)
    return parent_of(item, depsgraph, array(item.parent.evaluated_get(depsgraph).matrix_world), posed=True)


def is_plain(item):
    """Whether the parent's part follows from the parent alone, and so does not change by a rounding as the
    field moves the object."""
    parent = item.parent
    if item.parent_type == "BONE":
        return item.parent_bone in parent.data.bones
    return item.parent_type == "OBJECT" and not (parent.type == "CURVE" and parent.data.use_path)


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


# Carriers of whole objects, by delta transforms, and of armatures, by pose bones.


class PoseCarrier(Carrier):
    """Base of carriers that write to an object's channels; the user's own values are stored in the entry's
    `base`, as JSON. `state(item)` is {name: numbers} of these channels, `put_state` writes them.
    """

    def bind(self, context, item, entry):
        if not entry.base:
            entry.base, entry.base_kind = json.dumps(self.state(item)), self.base_kind

    def snapshot(self, item, entry):
        return self.state(item), entry.base, base_kind_of(entry)

    def restore(self, item, entry, before):
        state, entry.base, entry.base_kind = before
        self.put_state(item, state)

    @classmethod
    def own_state(cls, item, entry):
        """The user's own state, without the field's motion."""
        return cls.state(item) | (json.loads(entry.base) if base_kind_of(entry) == cls.base_kind else {})

    @classmethod
    def release(cls, item, entry):
        if base_kind_of(entry) == cls.base_kind:
            cls.put_state(item, json.loads(entry.base))
            entry.base, entry.base_kind = "", "NONE"


def base_kind_of(entry):
    """The kind of the entry's `base`; files from versions without `base_kind` tell it by the base's keys."""
    if not entry.base or entry.base_kind != "NONE":
        return entry.base_kind
    return "TRANSFORM" if set(DELTAS) == set(json.loads(entry.base)) else "BONES"


class TransformCarrier(PoseCarrier):
    """Any object as a whole, by its delta transforms: its own channels, keys and constraints stay."""

    base_kind = "TRANSFORM"

    def read(self, context, item):
        if item.rotation_mode == "AXIS_ANGLE":
            raise UserError("{name} turns by Axis Angle; choose another rotation mode", item)
        corners = array([tuple(corner) for corner in item.bound_box])
        if item.type == "EMPTY" or not np.ptp(corners, axis=0).any():
            return spaces.frame_points(item.empty_display_size if item.type == "EMPTY" else 0.05)
        return corners

    def basis(self, item, entry, depsgraph):
        return own_basis(item.evaluated_get(depsgraph), self.own_state(item, entry))

    def moved(self, rest, now, parent, after):
        """(4, 4) own transform of the object, by the rigid motion that fits its moved points."""
        whole = spaces.rigid_motion_of(transform(rest, self.points), after)
        return inverse(parent) @ whole @ rest

    def present(self, item, entry):
        return own_basis(item, self.state(item)) if base_kind_of(entry) == self.base_kind else None

    def rebased(self, shape, own, parent):
        return parent @ shape

    @classmethod
    def release(cls, item, entry):
        forget_baked(item)
        super().release(item, entry)

    def write(self, item, entry, basis):
        base = self.own_state(item, entry)
        turn = spaces.turn_between(unflattened(own_basis(item, base)), basis)
        turn = Matrix(turn.tolist()) @ base_turn(item, base).to_matrix()
        motion.written.add(item.session_uid)
        item.delta_location = (basis[:3, 3] - array(item.location)).tolist()
        if item.rotation_mode == "QUATERNION":
            item.delta_rotation_quaternion = turn.to_quaternion()
        else:
            item.delta_rotation_euler = turn.to_euler(item.rotation_mode)

    @staticmethod
    def state(item):
        return {name: list(getattr(item, name)) for name in DELTAS}

    @staticmethod
    def put_state(item, state):
        for name, value in state.items():
            setattr(item, name, value)


DELTAS = ("delta_location", "delta_rotation_euler", "delta_rotation_quaternion")
BAKED_GROUP = "ARAP Fields"  # F-curve group of delta transforms that a bake keyed


def forget_baked(item):
    """Removes a bake's F-curves of delta transforms; the user's own stay."""
    remove_curves(item, lambda one: one.group is not None and one.group.name == BAKED_GROUP)


def own_basis(item, base):
    """(4, 4) local transform of an object with the delta transforms of `base`."""
    quaternion = item.rotation_mode == "QUATERNION"
    rotation = item.rotation_quaternion if quaternion else item.rotation_euler.to_quaternion()
    location = item.location + Vector(base["delta_location"])
    scale = Vector([a * b for a, b in zip(item.scale, item.delta_scale, strict=True)])
    return array(Matrix.LocRotScale(location, base_turn(item, base) @ rotation, scale))


def base_turn(item, base):
    if item.rotation_mode == "QUATERNION":
        return Quaternion(base["delta_rotation_quaternion"])
    return Euler(base["delta_rotation_euler"], item.rotation_mode).to_quaternion()


class BonesCarrier(PoseCarrier):
    """An armature: each pose bone is moved with its head and points to its moved tail."""

    base_kind = "BONES"

    def read(self, context, item):
        if item.pose is None or not len(item.pose.bones):
            raise UserError("The armature {rig} has no bones to pose", rig=item.name)
        bones = list(item.pose.bones)  # parents come before their children
        self.names = [bone.name for bone in bones]
        self.parents = [self.names.index(bone.parent.name) if bone.parent else -1 for bone in bones]
        self.rest = np.stack([array(bone.bone.matrix_local) for bone in bones])
        self.connected = [bone.bone.use_connect for bone in bones]
        self.lengths = [bone.bone.length for bone in bones]
        self.poses = None
        return spaces.bone_points(self.rest, self.lengths)

    def take_base(self, item, entry):
        """Sets `points` from the user's own pose."""
        bases = self.own_state(item, entry)
        bases = np.array([bases[name] for name in self.names], dtype=np.float64)
        self.poses = spaces.posed(self.rest, self.parents, bases)
        self.points = spaces.bone_points(self.poses, self.lengths)

    def moved(self, rest, now, parent, after):
        before = transform(rest, self.points)
        in_solve = rest @ self.poses
        return inverse(now) @ spaces.bone_poses(in_solve, before, after)

    def rebased(self, shape, own, parent):
        return own @ shape

    def write(self, item, entry, targets):
        motion.written.add(item.session_uid)
        bases = spaces.chained(self.rest, self.parents, targets, self.connected)
        self.put_state(item, dict(zip(self.names, bases.tolist(), strict=True)))

    @staticmethod
    def state(item):
        return {bone.name: [list(row) for row in bone.matrix_basis] for bone in item.pose.bones}

    @staticmethod
    def put_state(item, state):
        for name, basis in state.items():
            if name in item.pose.bones:
                item.pose.bones[name].matrix_basis = Matrix(basis)
