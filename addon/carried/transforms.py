# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that are carried as a whole, and armatures bone by bone."""

import json

import numpy as np
from mathutils import Euler, Matrix, Quaternion, Vector

from ..core.errors import UserError
from ..core.geometry import carrying
from ..core.geometry.spaces import inverse, transform
from ..field_modifier import motion
from .carriers import Carrier
from .places import array


class TransformCarrier(Carrier):
    """Any object as a whole, by its delta transforms: its own channels, keys and constraints stay."""

    is_transform = True

    def read(self, context, item):
        if item.rotation_mode == "AXIS_ANGLE":
            raise UserError("{name} turns by Axis Angle; choose another rotation mode", name=item.name)
        corners = array([tuple(corner) for corner in item.bound_box])
        if item.type == "EMPTY" or not np.ptp(corners, axis=0).any():
            return carrying.frame_points(item.empty_display_size if item.type == "EMPTY" else 0.05)
        return corners

    def basis(self, item, entry, depsgraph):
        location, rotation, scale = own_channels(item.evaluated_get(depsgraph), base_of(item, entry))
        return array(Matrix.LocRotScale(location, rotation, scale))

    def moved(self, rest, now, parent, after):
        """The (4, 4) own motion that takes the object, as a whole, to where its points go."""
        whole = carrying.rigid_motion_of(transform(rest, self.points), after)
        return inverse(parent) @ whole @ rest

    def bind(self, context, item, entry):
        if not entry.base:
            entry.base = json.dumps(deltas(item))

    def write(self, item, entry, basis):
        base = base_of(item, entry)
        before = array(Matrix.LocRotScale(*own_channels(item, base)))
        turn = Matrix(carrying.turn_between(before, basis).tolist()) @ base_turn(item, base).to_matrix()
        motion.written.add(item.session_uid)
        item.delta_location = (basis[:3, 3] - array(item.location)).tolist()
        if item.rotation_mode == "QUATERNION":
            item.delta_rotation_quaternion = turn.to_quaternion()
        else:
            item.delta_rotation_euler = turn.to_euler(item.rotation_mode)

    def snapshot(self, item, entry):
        return deltas(item), entry.base

    def restore(self, item, entry, before):
        put_deltas(item, before[0])
        entry.base = before[1]

    @staticmethod
    def release(item, entry):
        if entry.base:
            put_deltas(item, json.loads(entry.base))
            entry.base = ""


DELTAS = ("delta_location", "delta_rotation_euler", "delta_rotation_quaternion")


def deltas(item):
    return {name: list(getattr(item, name)) for name in DELTAS}


def put_deltas(item, values):
    for name, value in values.items():
        setattr(item, name, value)


def base_of(item, entry):
    """The deltas that are the user's own."""
    return json.loads(entry.base) if entry.base else deltas(item)


def own_rotation(item):
    """The rotation channel as a quaternion."""
    if item.rotation_mode == "QUATERNION":
        return item.rotation_quaternion.copy()
    return item.rotation_euler.to_quaternion()


def own_channels(item, base):
    """(location, rotation, scale) of an object's channels with these deltas."""
    location = item.location + Vector(base["delta_location"])
    scale = Vector([a * b for a, b in zip(item.scale, item.delta_scale, strict=True)])
    return location, base_turn(item, base) @ own_rotation(item), scale


def base_turn(item, base):
    if item.rotation_mode == "QUATERNION":
        return Quaternion(base["delta_rotation_quaternion"])
    return Euler(base["delta_rotation_euler"], item.rotation_mode).to_quaternion()


class BonesCarrier(Carrier):
    """An armature: each bone's pose follows, heads where they go, bones towards their moved tails."""

    def read(self, context, item):
        if item.pose is None or not len(item.pose.bones):
            raise UserError("the armature {rig} has no bones to pose", rig=item.name)
        bones = list(item.pose.bones)  # parents come before their children
        self.names = [bone.name for bone in bones]
        self.parents = [self.names.index(bone.parent.name) if bone.parent else -1 for bone in bones]
        self.rest = np.stack([array(bone.bone.matrix_local) for bone in bones])
        self.connected = [bone.bone.use_connect for bone in bones]
        self.lengths = [bone.bone.length for bone in bones]
        self.poses = None
        return carrying.bone_points(self.rest, self.lengths)

    def take_base(self, item, entry):
        """The points are those of the pose that is the user's own."""
        bases = base_poses(item, entry)
        self.poses = carrying.posed(self.rest, self.parents, np.stack([bases[name] for name in self.names]))
        self.points = carrying.bone_points(self.poses, self.lengths)

    def moved(self, rest, now, parent, after):
        before = transform(rest, self.points)
        in_solve = rest @ self.poses
        return inverse(now) @ carrying.bone_poses(in_solve, before, after)

    def bind(self, context, item, entry):
        if not entry.base:
            bases = {bone.name: array(bone.matrix_basis).tolist() for bone in item.pose.bones}
            entry.base = json.dumps(bases)

    def write(self, item, entry, targets):
        motion.written.add(item.session_uid)
        bases = carrying.chained(self.rest, self.parents, targets, self.connected)
        for name, basis in zip(self.names, bases, strict=True):
            item.pose.bones[name].matrix_basis = Matrix(basis.tolist())

    def snapshot(self, item, entry):
        return {bone.name: bone.matrix_basis.copy() for bone in item.pose.bones}, entry.base

    def restore(self, item, entry, before):
        put_poses(item, before[0])
        entry.base = before[1]

    @staticmethod
    def release(item, entry):
        put_poses(item, {name: Matrix(basis.tolist()) for name, basis in base_poses(item, entry).items()})
        entry.base = ""


def put_poses(item, bases):
    for name, basis in bases.items():
        if name in item.pose.bones:
            item.pose.bones[name].matrix_basis = basis


def base_poses(item, entry):
    """{bone: (4, 4) own motion} that is the user's own."""
    noted = json.loads(entry.base) if entry.base else {}
    return {b.name: np.array(noted.get(b.name, b.matrix_basis), dtype=np.float64) for b in item.pose.bones}
