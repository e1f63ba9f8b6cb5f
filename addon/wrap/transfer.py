# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfers a wrapped object's data to its target: shape keys, groups, attributes, edges, armature."""

import json
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils.kdtree import KDTree

from ..blender import mesh_arrays, modifier_stack, vertex_groups
from ..blender.evaluation import updated
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..core.geometry import transfer
from ..core.geometry.spaces import facing, mirrors
from ..core.geometry.transfer import carried_marks
from ..core.settings.choices import TRANSFERRED
from ..names import NEUTRAL_KEY, OFFSETS, TURNS
from ..results.placement import single_user
from . import garments

# Transfers shape keys, with their values, to a target.
#
# A wrap fits the evaluated shape, with its keys' values, to the target. On the target the same values would
# move it a second time: one more key subtracts their motion, so that the target keeps its shape at them.


def keys_of(source):
    """The keys to transfer: all but the Basis and NEUTRAL_KEY."""
    keys = source.data.shape_keys
    if keys is None:
        return []
    return [block for block in keys.key_blocks[1:] if block.name != NEUTRAL_KEY]


def key_refusal(source, target):
    """UserError that says why the keys of a source cannot be transferred; else None."""
    for item in (source, target):
        if item.data.shape_keys is not None and not item.data.shape_keys.use_relative:
            return UserError(
                "The shape keys of {name} are absolute; only relative ones can be transferred", item
            )
    if not modifier_stack.keeps_vertices(source):
        return UserError(
            "Modifiers of {name} change its vertices; apply them, or leave out Shape Keys", source
        )
    return None


def shown_values(source):
    """{name: value} of the keys that act in the evaluated shape."""
    blocks, values = keys_of(source), {}
    if source.show_only_shape_key:
        block = source.active_shape_key
        while block in blocks and block.name not in values:
            values[block.name], block = 1.0, block.relative_key
        return values
    return {block.name: block.value for block in blocks if block.value and not block.mute}


def since_wrapped(source):
    """{name: value} of the keys at the time of the wrap; None if these have not changed."""
    kept = settings_of(source).wrap.shown_keys
    values = json.loads(kept) if kept else {}
    if not kept or values == shown_values(source):
        return None
    return {block.name: values.get(block.name, 0.0) for block in keys_of(source)}


def shape_at(context, item, kept, values):
    """(n, 3) vertices of an object with the modifiers `kept` and the keys at `values`, {name: value}."""
    mesh = item.data.copy()
    try:
        with modifier_stack.staged(context, item, kept) as (copied, layer):
            copied.data, copied.show_only_shape_key = mesh, item.show_only_shape_key and not values
            if mesh.shape_keys is not None:
                mesh.shape_keys.animation_data_clear()
            for name, value in values.items():
                key = mesh.shape_keys.key_blocks[name]
                key.mute, key.value = False, value
            return mesh_arrays.positions(copied.evaluated_get(updated(layer)).data)
    finally:
        bpy.data.meshes.remove(mesh)


def key_offsets(source):
    """(k, n, 3) offsets of the keys, each from the key that it is relative to."""
    blocks = keys_of(source)
    if not blocks:
        return np.empty((0, len(source.data.vertices), 3))
    points = {block: points_of(block) for block in source.data.shape_keys.key_blocks}
    basis = source.data.shape_keys.reference_key
    starts = [basis if is_in_circle(block) else block.relative_key for block in blocks]
    return np.array([points[block] - points[start] for block, start in zip(blocks, starts, strict=True)])


def carry_keys(source, target, displacements):
    """Makes the source's keys on the target with these displacements (k, m, 3); returns their number."""
    blocks = keys_of(source)
    if not blocks:
        return 0
    basis = source.data.shape_keys.reference_key
    if target.data.shape_keys is None:
        target.shape_key_add(name=basis.name, from_mix=False)
    from_basis = {block for block in blocks if is_in_circle(block)}
    carried = dict(zip(blocks, displacements, strict=True))
    made = {block: key_named(target, block.name) for block in blocks}
    made[basis] = target.data.shape_keys.reference_key
    start_of = {block: block.relative_key if block.relative_key in made else basis for block in blocks}
    locked = {block for block in blocks if made[block].lock_shape}
    shapes = {block: points_of(made[block]) for block in (basis, *locked)}

    def shape_of(block):
        """(m, 3) points of a key, recursively, as keys may be relative to other new ones."""
        if block not in shapes:
            start = basis if block in from_basis else start_of[block]
            shapes[block] = shape_of(start) + carried[block]
        return shapes[block]

    for block in [block for block in blocks if block not in locked]:
        key = made[block]
        mesh_arrays.put_vectors(key.data, shape_of(block), "co")
        key.relative_key = made[start_of[block]]
        for name in ("slider_min", "slider_max", "value", "mute", "vertex_group", "interpolation"):
            setattr(key, name, getattr(block, name))
    return len(blocks) - len(locked)


def is_in_circle(block):
    """Whether a key is relative to itself, directly or through other keys."""
    passed, start = set(), block.relative_key
    while start not in passed and start != block:
        passed.add(start)
        start = start.relative_key
    return start == block


def points_of(block):
    return mesh_arrays.vectors(block.data, "co").astype(float)


def key_named(target, name):
    return target.data.shape_keys.key_blocks.get(name) or target.shape_key_add(name=name, from_mix=False)


def take_keys_back(source, target):
    """Makes the key that subtracts the values of the wrap; call it after the target has its vertex groups."""
    kept, keys = settings_of(source).wrap.shown_keys, target.data.shape_keys.key_blocks
    values = json.loads(kept) if kept else shown_values(source)
    moved = {keys[block.name]: values[block.name] for block in keys_of(source) if values.get(block.name)}
    if not moved:
        if NEUTRAL_KEY in keys:
            target.shape_key_remove(keys[NEUTRAL_KEY])
        return
    masks = {key.vertex_group for key in moved} & set(target.vertex_groups.keys())
    indices = {name: target.vertex_groups[name].index for name in masks}
    weights = vertex_groups.weights_in(target.data, indices)
    shape, everywhere = points_of(keys[0]), np.ones(len(target.data.vertices))
    for key, value in moved.items():
        weight = value * weights.get(key.vertex_group, everywhere)
        shape -= weight[:, None] * (points_of(key) - points_of(key.relative_key))
    key = key_named(target, NEUTRAL_KEY)
    mesh_arrays.put_vectors(key.data, shape, "co")
    key.relative_key, key.value, key.mute = keys[0], 1.0, False


# Transfers a wrapped object's data to its target: shape keys, groups, attributes, edges, armature.

# The data of a wrapped mesh to transfer, read at once; nothing is written meanwhile.

# {attribute type: (RNA name of the value, numbers per value, whether values can be interpolated)}.
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
# Edge marks: {attribute name: type}.
EDGE_MARKS = {
    "uv_seam": "BOOLEAN",
    ".uv_seam": "BOOLEAN",
    "sharp_edge": "BOOLEAN",
    "freestyle_edge": "BOOLEAN",
    "crease_edge": "FLOAT",
    "bevel_weight_edge": "FLOAT",
}


@dataclass(frozen=True)
class Layer:
    """An attribute and its values (n, width)."""

    name: str
    domain: str
    data_type: str
    values: np.ndarray

    @property
    def is_smooth(self):
        return TYPES[self.data_type][2]

    def put(self, mesh, values):
        """Writes values to a mesh as this attribute."""
        old = mesh.attributes.get(self.name)
        if old is not None and (old.domain, old.data_type) != (self.domain, self.data_type):
            mesh.attributes.remove(old)
            old = None
        new = old or mesh.attributes.new(self.name, self.data_type, self.domain)
        flat = np.ascontiguousarray(values.ravel(), dtype=number_of(self.data_type))
        new.data.foreach_set(TYPES[self.data_type][0], flat)


def number_of(data_type):
    return bool if data_type == "BOOLEAN" else np.int32 if "INT" in data_type else np.float32


def layer_of(attribute):
    field, width, _ = TYPES[attribute.data_type]
    kind = bool if attribute.data_type == "BOOLEAN" else np.float32
    values = np.empty(len(attribute.data) * width, kind)
    attribute.data.foreach_get(field, values)
    return Layer(attribute.name, attribute.domain, attribute.data_type, values.reshape(-1, width))


class Given:
    """The vertices at rest and moved, triangles by vertices and by corners, groups, attributes, edges."""

    def __init__(self, context, source):
        rest = mesh_arrays.read(context, source, in_place=True)
        self.rest, self.triangles = rest.vertices, rest.triangles
        indices = {group.name: group.index for group in source.vertex_groups}
        with modifier_stack.moved_mesh(context, source) as mesh:
            self.moved = mesh_arrays.positions(mesh)
            if len(self.moved) != len(self.rest):
                raise UserError("{name} changed while it was worked on; run again", source)
            mesh.calc_loop_triangles()
            corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
            mesh.loop_triangles.foreach_get("loops", corners)
            self.corners = corners.reshape(-1, 3)
            self.groups = vertex_groups.weights_in(mesh, indices)
            names = {layer.name for layer in mesh.uv_layers}
            layers = [layer_of(one) for one in mesh.attributes if one.data_type in TYPES]
            own = [a.name for a in mesh.attributes if a.is_required or a.is_internal]
            edges = np.empty(2 * len(mesh.edges), np.int32)
            mesh.edges.foreach_get("vertices", edges)
        values = since_wrapped(source)
        if values is not None:
            before, stack = modifier_stack.before(source, in_place=True), list(source.modifiers)
            self.rest = shape_at(context, source, before, values)
            through = stack[: modifier_stack.place(source) + 1]
            self.moved = shape_at(context, source, through, values)
        kept = {*own, *names, OFFSETS, TURNS, "custom_normal"}
        self.edges = edges.reshape(-1, 2)
        self.uv_maps = [one for one in layers if one.name in names]
        self.marks = [one for one in layers if one.domain == "EDGE" and one.name in EDGE_MARKS]
        self.attributes = [
            one
            for one in layers
            if one.domain in ("POINT", "CORNER") and one.name not in kept and not one.name.startswith(".")
        ]

    def mirror(self, matrix):
        """(3, 3) reflection to apply to the rest shape if `matrix` mirrors, so that the whole map does not;
        orients the triangles outwards."""
        self.triangles, self.corners = (facing(one, matrix) for one in (self.triangles, self.corners))
        return np.diag([-1.0 if mirrors(matrix) else 1.0, 1.0, 1.0])


# Transfers a wrapped object's data to its target: shape keys, groups, attributes, edges, armature.

MOST_UV_MAPS = 8  # of a mesh, in Blender
LEAST_WEIGHT = 1e-4  # vertices below it are not assigned to a group


def not_wrapped(source):
    """UserError if a source has no wrap to transfer from; else None."""
    if modifier_stack.top(source) is None:
        return UserError("Wrap {name} first, with Modifier as its result", source)
    return None


def refusal(source, target):
    """UserError that says why nothing can be transferred; else None."""
    if reason := not_wrapped(source):
        return reason
    if target.library is not None or target.data.library is not None:
        return UserError("{name} is linked from another file and cannot be changed", target)
    if target.override_library is not None or target.data.override_library is not None:
        return UserError("{name} is a library override; its mesh cannot be changed", target)
    if target.mode == "EDIT":
        return UserError("Leave Edit Mode of {name} first", target)
    return mesh_arrays.nothing_in(target.name, len(target.data.vertices), len(target.data.polygons))


def groups_named(groups, text, source):
    """{name: weights} of the groups whose names a text has between commas; all for an empty one."""
    names = [text] if text in groups else [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        if name not in groups:
            raise UserError("{name} has no vertex group {group}", source, group=name)
    return {name: groups[name] for name in names or groups}


class Transfer:
    """Transfers data from the source's wrapped mesh to the target's own mesh, by a Match.

    `weights`: {name: (n,)} of the vertex groups to transfer, of which the target takes the share `mix`.
    """

    def __init__(self, context, source, target, match, weights, mix):
        self.context, self.source, self.target, self.match = context, source, target, match
        self.given, self.moved, self.own, self.places = match.given, match.moved, match.own, match.places
        self.weights, self.mix, self.notes = weights, mix, []

    def carry(self, kinds):
        """Transfers these kinds of data, or none of them; returns {label: count}."""
        if "UV_MAPS" in kinds:
            self.require_room()
        single_user(self.target)
        steps = {
            "KEYS": self.keys,
            "GROUPS": self.groups,
            "ATTRIBUTES": self.attributes,
            "EDGES": self.edges,
            "UV_MAPS": self.uv_maps,
            "ARMATURE": self.armature,
            "CARRIED": self.carried,
        }
        if self.match.is_aside:
            kinds = self.without_objects(kinds)
        done = {label: steps[kind]() for kind, label, _ in TRANSFERRED if kind in kinds}
        if self.match.displacements is not None:
            take_keys_back(self.source, self.target)
            garments.copy_drivers(self.source, self.target)
        return done

    def require_room(self):
        """Raises UserError if the target cannot take the UV maps."""
        names = {*self.target.data.uv_layers.keys(), *(layer.name for layer in self.given.uv_maps)}
        if len(names) > MOST_UV_MAPS:
            raise UserError("{name} has no room for another UV map", self.target)

    def without_objects(self, kinds):
        """These kinds but for those that copy objects, which have places in the world."""
        if settings_of(self.source).carried or settings_of(self.source).under_rig:
            names = {"name": self.source.name, "target": self.target.name}
            self.notes.append(
                translated("armature and carried objects are copied where {name} lies on {target}", **names)
            )
        return [kind for kind in kinds if kind not in ("ARMATURE", "CARRIED")]

    def keys(self):
        displacements = self.match.displacements
        return 0 if displacements is None else carry_keys(self.source, self.target, displacements)

    def groups(self):
        done, groups = 0, self.target.vertex_groups
        own = vertex_groups.weights_in(
            self.target.data, {name: groups[name].index for name in self.weights if name in groups}
        )
        for name, weights in self.weights.items():
            there = groups.get(name)
            if there is None or not there.lock_weight:
                carried = self.mix * self.places.values(weights) + (1.0 - self.mix) * own.get(name, 0.0)
                vertex_groups.put(self.target, name, np.where(carried > LEAST_WEIGHT, carried, 0.0))
                done += 1
        return done

    def attributes(self):
        mesh = self.target.data
        for layer in self.given.attributes:
            on_vertices = layer.domain == "POINT"
            at = (self.given.triangles if on_vertices else self.given.corners)[self.places.triangles]
            shares = self.places.shares
            shares = shares if layer.is_smooth else np.eye(3)[shares.argmax(axis=1)]
            carried = (shares[:, :, None] * layer.values[at].astype(float)).sum(axis=1)
            layer.put(mesh, carried if on_vertices else carried[mesh_arrays.corner_vertices(mesh)])
        mesh.update()
        return len(self.given.attributes)

    def edges(self):
        """Transfers seams, sharp edges, creases and other edge marks."""
        mesh, done = self.target.data, 0
        edges = np.empty(2 * len(mesh.edges), np.int32)
        mesh.edges.foreach_get("vertices", edges)
        tree = KDTree(len(self.own))
        for index, vertex in enumerate(self.own):
            tree.insert(vertex, index)
        tree.balance()
        for layer in self.given.marks:
            marked = np.flatnonzero(layer.values[:, 0])
            if len(marked):
                ends = self.moved[self.given.edges[marked]]
                nearest = np.array([[tree.find(end)[1] for end in pair] for pair in ends])
                values = layer.values[marked, 0].astype(float)
                layer.put(mesh, carried_marks(ends, values, nearest, self.own, edges.reshape(-1, 2)))
                done += 1
        mesh.update()
        return done

    def uv_maps(self):
        mesh = self.target.data
        starts = np.empty(len(mesh.polygons), np.int32)
        mesh.polygons.foreach_get("loop_start", starts)
        corners = mesh_arrays.corner_vertices(mesh)
        points, triangles, face = transfer.fan(self.own, starts, corners)
        places = self.match.places_of(points, triangles)
        crossing = set()
        for layer in self.given.uv_maps:
            values, beyond = transfer.corner_coordinates(
                *(points, places.triangles, places.shares, corners, face),
                *(self.moved[self.given.triangles], layer.values[self.given.corners].astype(float)),
            )
            there = mesh.uv_layers.get(layer.name) or mesh.uv_layers.new(name=layer.name, do_init=False)
            there.uv.foreach_set("vector", values.astype(np.float32).ravel())
            crossing |= set(face[beyond].tolist())
        if crossing:
            self.notes.append(translated("{count} faces cross a seam of the texture", count=len(crossing)))
        mesh.update()
        return len(self.given.uv_maps)

    def armature(self):
        """Gives the target a copy of the armature, if its bones are fitted to the wrapped shape."""
        if not settings_of(self.source).under_rig:
            return 0
        done, made = 0, {}
        for given in self.source.modifiers:
            if modifier_stack.rig_of(given) is None:
                continue
            if not settings_of(given.object).rest_bones:
                self.notes.append(translated("the bones of {rig} are not fitted", rig=given.object.name))
                continue
            modifier = self.target.modifiers.get(given.name)
            if modifier is None or modifier.type != "ARMATURE":
                modifier = self.target.modifiers.new(given.name, "ARMATURE")
            if modifier.object is None or modifier.object == given.object:
                modifier.object = made[given.object] = garments.copied_object(given.object, self.target)
            for name in ("use_deform_preserve_volume", "use_vertex_groups", "use_bone_envelopes"):
                setattr(modifier, name, getattr(given, name))
            done += 1
        garments.remap_copies(made, garments.counterparts(self.source, self.target))
        return done

    def carried(self):
        own = self.own, self.match.triangles
        done, notes = garments.copies(self.context, self.source, self.target, self.given, own)
        self.notes += notes
        return done


def message(target, counts, notes):
    """The line that reports what was transferred."""
    listed = ", ".join([*(f"{translated(label)}: {count}" for label, count in counts.items()), *notes])
    return translated("{name} has {what}", name=target.name, what=listed)
