# SPDX-License-Identifier: GPL-3.0-or-later
"""Carriers of whole objects, by delta transforms, and of armatures, by pose bones."""

import json

import numpy as np
from mathutils import Euler, Matrix, Quaternion, Vector

from ..blender.actions import remove_curves
from ..core.errors import UserError
from ..core.geometry import posing
from ..core.geometry.spaces import inverse, transform, unflattened
from ..field_modifier import motion
from .carriers import Carrier
from .world_matrices import array


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
            return posing.frame_points(item.empty_display_size if item.type == "EMPTY" else 0.05)
        return corners

    def basis(self, item, entry, depsgraph):
        return own_basis(item.evaluated_get(depsgraph), self.own_state(item, entry))

    def moved(self, rest, now, parent, after):
        """(4, 4) own transform of the object, by the rigid motion that fits its moved points."""
        whole = posing.rigid_motion_of(transform(rest, self.points), after)
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
        turn = posing.turn_between(unflattened(own_basis(item, base)), basis)
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
        return posing.bone_points(self.rest, self.lengths)

    def take_base(self, item, entry):
        """Sets `points` from the user's own pose."""
        bases = self.own_state(item, entry)
        bases = np.array([bases[name] for name in self.names], dtype=np.float64)
        self.poses = posing.posed(self.rest, self.parents, bases)
        self.points = posing.bone_points(self.poses, self.lengths)

    def moved(self, rest, now, parent, after):
        before = transform(rest, self.points)
        in_solve = rest @ self.poses
        return inverse(now) @ posing.bone_poses(in_solve, before, after)

    def rebased(self, shape, own, parent):
        return own @ shape

    def write(self, item, entry, targets):
        motion.written.add(item.session_uid)
        bases = posing.chained(self.rest, self.parents, targets, self.connected)
        self.put_state(item, dict(zip(self.names, bases.tolist(), strict=True)))

    @staticmethod
    def state(item):
        return {bone.name: [list(row) for row in bone.matrix_basis] for bone in item.pose.bones}

    @staticmethod
    def put_state(item, state):
        for name, basis in state.items():
            if name in item.pose.bones:
                item.pose.bones[name].matrix_basis = Matrix(basis)
