# SPDX-License-Identifier: GPL-3.0-or-later
"""What a wrapped object has, carried over to its target: shape keys, vertex groups, attributes, armature."""

import numpy as np

from ..blender import mesh_arrays, modifier_stack, vertex_groups
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..core.errors import UserError, refuse
from ..core.geometry.spaces import transform
from ..core.runtime import native
from ..core.settings.choices import TRANSFERRED
from ..handles.empties import matrix_of
from ..names import OFFSETS, TURNS
from ..results.placement import single_user

# Attributes' types: (name of a value in Blender, numbers a value, whether values between two make sense).
TYPES = {
    "FLOAT": ("value", 1, True),
    "FLOAT2": ("vector", 2, True),
    "FLOAT_VECTOR": ("vector", 3, True),
    "FLOAT_COLOR": ("color", 4, True),
    "BYTE_COLOR": ("color", 4, True),
    "QUATERNION": ("value", 4, False),
    "INT": ("value", 1, False),
    "INT8": ("value", 1, False),
    "BOOLEAN": ("value", 1, False),
}
LEAST_WEIGHT = 1e-4  # what is below is no member of a group


def not_wrapped(source):
    """Why a source has nothing to hand on yet, as a UserError; None where it has."""
    if modifier_stack.find(source) is None:
        return UserError("Wrap {name} first, with Modifier as its result", source)
    return None


def refusal(source, target):
    """Why nothing can be carried over, as a UserError; None where it can."""
    if reason := not_wrapped(source):
        return reason
    if target.library is not None or target.data.library is not None:
        return UserError("{name} is linked from another file and cannot be changed", target)
    if target.override_library is not None or target.data.override_library is not None:
        return UserError("{name} is a library override; its mesh cannot be changed", target)
    if target.mode == "EDIT":
        return UserError("Leave Edit Mode of {name} first", target)
    return mesh_arrays.nothing_in(target.name, len(target.data.vertices), len(target.data.polygons))


def has_keys(source):
    keys = source.data.shape_keys
    return keys is not None and len(keys.key_blocks) > 1


def refusal_of_keys(source):
    """Why the keys of a source cannot be carried over, as a UserError; None where they can."""
    if not source.data.shape_keys.use_relative:
        return UserError(
            "The shape keys of {name} are absolute; only relative ones can be transferred", source
        )
    if not modifier_stack.keeps_vertices(source):
        return UserError(
            "Modifiers of {name} change its vertices; apply them, or leave out Shape Keys", source
        )
    return None


class Transfer:
    """One source and one target: what is carried goes from the first's wrapped mesh to the second's own."""

    def __init__(self, context, source, target):
        refuse(refusal(source, target))
        self.context, self.source, self.target = context, source, target
        rest = mesh_arrays.read(context, source, in_place=True)
        with modifier_stack.moved_mesh(context, source) as mesh:
            moved = mesh_arrays.positions(mesh)
        if len(moved) != len(rest.vertices):
            raise UserError("{name} changed while it was worked on; run again", source)
        to_world, from_world = matrix_of(source), np.linalg.inv(matrix_of(target))
        self.triangles = rest.triangles
        own = mesh_arrays.positions(target.data)
        # In the target's coordinates, as keys are.
        self.places = native.library().Correspondence(
            transform(from_world @ to_world, moved),
            (rest.vertices, rest.triangles),
            (own, mesh_arrays.triangles(target.data)),
        )

    def carry(self, kinds):
        """Carries the kinds over; returns how many of each by label."""
        if "KEYS" in kinds and has_keys(self.source):
            refuse(refusal_of_keys(self.source))
        single_user(self.target)
        steps = {
            "KEYS": self.keys,
            "GROUPS": self.groups,
            "ATTRIBUTES": self.attributes,
            "ARMATURE": self.armature,
        }
        return {label: steps[kind]() for kind, label, _ in TRANSFERRED if kind in kinds}

    def keys(self):
        given = self.source.data.shape_keys
        if not has_keys(self.source):
            return 0
        if self.target.data.shape_keys is None:
            self.target.shape_key_add(name=given.reference_key.name, from_mix=False)
        blocks = [block for block in given.key_blocks if block != given.reference_key]
        places = {
            block.name: mesh_arrays.vectors(block.data, "co").astype(float) for block in given.key_blocks
        }
        offsets = [places[block.name] - places[block.relative_key.name] for block in blocks]
        carried = self.places.displacements(np.array(offsets))
        made = {given.reference_key.name: self.target.data.shape_keys.reference_key}
        for block in blocks:
            made[block.name] = self.key_named(block.name)
        shapes = {}

        def shape_of(block):
            """Keys may be relative to others that are made here too."""
            if block == given.reference_key:
                return mesh_arrays.vectors(made[block.name].data, "co").astype(float)
            if block.name not in shapes:
                shapes[block.name] = shape_of(block.relative_key) + carried[blocks.index(block)]
            return shapes[block.name]

        for block in blocks:
            key = made[block.name]
            mesh_arrays.put_vectors(key.data, shape_of(block), "co")
            key.relative_key = made[block.relative_key.name]
            for name in ("slider_min", "slider_max", "value", "mute", "vertex_group", "interpolation"):
                setattr(key, name, getattr(block, name))
        copy_drivers(given, self.target.data.shape_keys)
        return len(blocks)

    def key_named(self, name):
        return self.target.data.shape_keys.key_blocks.get(name) or self.target.shape_key_add(
            name=name, from_mix=False
        )

    def groups(self):
        indices = {group.name: group.index for group in self.source.vertex_groups}
        with modifier_stack.moved_mesh(self.context, self.source) as mesh:
            given = vertex_groups.weights_in(mesh, indices)
        done = 0
        for name, weights in given.items():
            there = self.target.vertex_groups.get(name)
            if there is None or not there.lock_weight:
                carried = self.places.values(weights)
                vertex_groups.put(self.target, name, np.where(carried > LEAST_WEIGHT, carried, 0.0))
                done += 1
        return done

    def attributes(self):
        done = 0
        uv_maps = {layer.name for layer in self.source.data.uv_layers}
        with modifier_stack.moved_mesh(self.context, self.source) as mesh:
            mesh.calc_loop_triangles()
            corners = np.array([one.loops for one in mesh.loop_triangles]).reshape(-1, 3)
            for attribute in mesh.attributes:
                known = TYPES.get(attribute.data_type)
                internal = attribute.is_required or attribute.is_internal or attribute.name.startswith(".")
                if known is None or internal or attribute.name in {*uv_maps, OFFSETS, TURNS, "custom_normal"}:
                    continue
                if attribute.domain in ("POINT", "CORNER"):
                    self.attribute(attribute, corners, *known)
                    done += 1
        self.target.data.update()
        return done

    def attribute(self, given, corners, field, width, smooth):
        values = np.empty(len(given.data) * width, bool if given.data_type == "BOOLEAN" else np.float32)
        given.data.foreach_get(field, values)
        values = values.reshape(-1, width)
        at = (self.triangles if given.domain == "POINT" else corners)[self.places.triangles]
        shares = self.places.shares if smooth else np.eye(3)[self.places.shares.argmax(axis=1)]
        carried = (shares[:, :, None] * values[at].astype(float)).sum(axis=1)
        mesh = self.target.data
        old = mesh.attributes.get(given.name)
        if old is not None and (old.domain, old.data_type) != (given.domain, given.data_type):
            mesh.attributes.remove(old)
            old = None
        new = old or mesh.attributes.new(given.name, given.data_type, given.domain)
        if given.domain == "CORNER":
            carried = carried[mesh_arrays.corner_vertices(mesh)]
        kind = bool if given.data_type == "BOOLEAN" else np.int32 if "INT" in given.data_type else np.float32
        new.data.foreach_set(field, np.ascontiguousarray(carried.ravel(), dtype=kind))

    def armature(self):
        """A rig of the target's own; only where the wrap fitted the bones to the wrapped shape."""
        if not settings_of(self.source).under_rig:
            return 0
        done = 0
        for given in self.source.modifiers:
            if given.type != "ARMATURE" or given.object is None:
                continue
            modifier = self.target.modifiers.get(given.name)
            if modifier is None or modifier.type != "ARMATURE":
                modifier = self.target.modifiers.new(given.name, "ARMATURE")
            if modifier.object is None or modifier.object == given.object:
                modifier.object = copied_rig(given.object, self.target)
            for name in ("use_deform_preserve_volume", "use_vertex_groups", "use_bone_envelopes"):
                setattr(modifier, name, getattr(given, name))
            done += 1
        return done


def copied_rig(rig, target):
    """A copy at the same place, in the target's collections."""
    copied = rig.copy()
    copied.data = rig.data.copy()
    copied.name = f"{rig.name} {target.name}"
    for home in target.users_collection:
        home.objects.link(copied)
    return copied


def copy_drivers(given, keys):
    """The same drivers on the keys of the same names."""
    if given.animation_data is None:
        return
    for curve in given.animation_data.drivers:
        if keys.animation_data is not None and keys.animation_data.drivers.find(curve.data_path):
            keys.driver_remove(curve.data_path)
        keys.animation_data_create().drivers.from_existing(src_driver=curve)


def message(target, counts):
    """What was carried, as the line to report."""
    listed = ", ".join(f"{translated(label)}: {count}" for label, count in counts.items())
    return translated("{name} has {what}", name=target.name, what=listed)
