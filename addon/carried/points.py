# SPDX-License-Identifier: GPL-3.0-or-later
"""Carried objects of points: where the field takes them, and stored frames that a cache plays."""

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack, references
from ..blender.evaluation import remove_curves
from ..blender.references import remove_mesh_object, remove_node_modifier
from ..core.errors import UserError
from ..field_modifier import cache_modifier, motion, node_group
from ..field_modifier.node_group import VECTORS, Graph, kept_group
from ..names import CACHE_MODIFIER, FIELD_MODIFIER, OFFSETS, PLAYED_GROUP, PLAYED_SUFFIX, ROWS, WARP_KEY
from .carriers import Carrier

# Attribute collections with the points of hair curves, point clouds and Grease Pencil.


def layers_of(item):
    """The attribute collections that hold an object's points; Grease Pencil has one per drawing."""
    if item.type != "GREASEPENCIL":
        return [item.data.attributes]
    drawings = [frame.drawing for layer in item.data.layers for frame in layer.frames]
    return [drawing.attributes for drawing in drawings if "position" in drawing.attributes]


# Playback of baked hair, point clouds and Grease Pencil, for which Blender has no cache modifier.
#
# A mesh without faces, in no scene, holds the points; it plays the frames by a Mesh Cache modifier or by
# shape keys, and a nodes modifier on the object reads each point's position from it. It plays and renders
# without the extension. A point attribute holds the vertex index plus 1; points that are drawn later have
# none, and stay.

VERSION = 1


def find_or_make():
    """The node group of the modifier."""
    return kept_group(PLAYED_GROUP, VERSION, build)


def build():
    graph = Graph(CACHE_MODIFIER)
    graph.fading_inputs("How far each point goes")
    graph.socket("Points", "INPUT", "NodeSocketObject", "Mesh that plays the points")
    graph.socket("Geometry", "OUTPUT", "NodeSocketGeometry")

    inputs = graph.node("NodeGroupInput").outputs
    played = graph.node("GeometryNodeObjectInfo", inputs["Points"]).outputs["Geometry"]
    row = graph.node("GeometryNodeInputNamedAttribute", ROWS, data_type="INT").outputs[0]
    known = graph.node("ShaderNodeMath", row, 0.5, operation="GREATER_THAN").outputs[0]
    vertex = graph.node("ShaderNodeMath", row, 1.0, operation="SUBTRACT").outputs[0]
    position = graph.node("GeometryNodeInputPosition").outputs[0]
    sampled = graph.node(
        "GeometryNodeSampleIndex", played, into={"Value": position, "Index": vertex}, **VECTORS
    ).outputs["Value"]
    strength = graph.node("ShaderNodeMath", inputs["Factor"], inputs["Mask"], operation="MULTIPLY").outputs[0]
    way = graph.node("ShaderNodeVectorMath", sampled, position, operation="SUBTRACT").outputs[0]
    moved = graph.node("ShaderNodeVectorMath", way, into={"Scale": strength}, operation="SCALE").outputs[0]
    graph.node("NodeGroupOutput", graph.set_position(inputs["Geometry"], known, moved))
    return graph.group


def find(item):
    """The modifier that plays an object's points, or None."""
    played = (m for m in item.modifiers if m.type == "NODES" and m.node_group is not None)
    return next((m for m in played if PLAYED_GROUP in m.node_group), None)


def play(item, points, counts):
    """Makes the object play a new mesh of these (n, 3) points, `counts` per drawing; returns the mesh's
    object, without frames yet. Removes an earlier bake."""
    layers = layers_of(item)
    if counts != [len(layer["position"].data) for layer in layers]:
        raise UserError("{name} changed while it was worked on; run again", item)
    remove(item)
    name = f"{item.name}{PLAYED_SUFFIX}"
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], [])
    first = 1
    for layer, count in zip(layers, counts, strict=True):
        rows = layer.get(ROWS) or layer.new(ROWS, "INT", "POINT")
        rows.data.foreach_set("value", list(range(first, first + count)))
        first += count
    field = modifier_stack.find(item)
    modifier = item.modifiers.new(CACHE_MODIFIER, "NODES")
    modifier.node_group = find_or_make()
    node_group.put(modifier, "Points", bpy.data.objects.new(name, mesh))
    if field is not None:
        node_group.put_attribute(modifier, "Mask", node_group.get_attribute(field, "Mask"))
        node_group.put(modifier, "Factor", node_group.get(field, "Factor"))
    item.modifiers.move(len(item.modifiers) - 1, 0)  # hair grown from these follows
    cache_modifier.set_playing(item, True, find(item))
    return node_group.get(modifier, "Points")


def remove(item):
    """Removes the bake from the object; the cache file stays."""
    modifier = find(item)
    if modifier is None:
        return
    cache_modifier.set_playing(item, False, modifier)
    played = node_group.get(modifier, "Points")
    remove_node_modifier(modifier)
    if played is not None and played.users == 0:
        remove_mesh_object(played)
    for layer in layers_of(item):
        if ROWS in layer:
            layer.remove(layer[ROWS])
    item.data.update_tag()


# Carriers of pointwise objects that are no meshes: by the field's modifier, or by a shape key.

BAKED_KEY = "ARAP Fields frame "  # prefix of baked keys of curves and lattices
SURFACE_NODE = "GeometryNodeDeformCurvesOnSurface"  # node that moves hair with its surface


def refuse_shared(item):
    if item.library is not None or item.data.library is not None or item.data.override_library is not None:
        raise UserError("{name} is linked from another file; make it local to carry it", item)
    if item.data.users > 1:
        raise UserError("{name} shares its data with other objects; make it single-user", item)


class AttributeCarrier(Carrier):
    """Hair curves, point clouds, Grease Pencil: a point attribute with offsets, and a modifier."""

    def read(self, context, item):
        refuse_shared(item)
        if any(follows_surface(modifier) for modifier in item.modifiers):
            raise UserError("{name} follows its surface by a modifier of its own", item)
        layers = layers_of(item)
        self.counts = [len(layer["position"].data) for layer in layers]
        points = [mesh_arrays.vectors(layer["position"].data) for layer in layers]
        return np.concatenate(points or [np.zeros((0, 3))]).astype(np.float64)

    def bind(self, context, item, entry):
        cache_modifier.set_playing(item, False, find(item))
        if modifier_stack.find(item) is None:
            references.refuse_new(item)
            modifier = item.modifiers.new(FIELD_MODIFIER, "NODES")
            modifier.node_group = node_group.find_or_make()
            item.modifiers.move(len(item.modifiers) - 1, 0)  # hair grown from these follows

    def write(self, item, entry, shape):
        if modifier_stack.find(item) is None:
            raise UserError("The modifier of {name} was removed", item)
        put_offsets(item, self.counts, shape - self.points.astype(np.float32))

    def snapshot(self, item, entry):
        if modifier_stack.find(item) is None:
            return None
        layers = layers_of(item)
        return [mesh_arrays.vectors(layer[OFFSETS].data) if OFFSETS in layer else None for layer in layers]

    def restore(self, item, entry, before):
        if before is None:
            self.release(item, entry)
            return
        for layer, offsets in zip(layers_of(item), before, strict=True):
            if offsets is not None and OFFSETS in layer and len(layer[OFFSETS].data) == len(offsets):
                mesh_arrays.put_vectors(layer[OFFSETS].data, offsets)
        item.data.update_tag()

    @staticmethod
    def release(item, entry):
        remove(item)
        modifier = modifier_stack.find(item)
        if modifier is not None:
            remove_node_modifier(modifier)
        for layer in layers_of(item):
            if OFFSETS in layer:
                layer.remove(layer[OFFSETS])
        item.data.update_tag()


def follows_surface(modifier):
    nodes = modifier.node_group.nodes if modifier.type == "NODES" and modifier.node_group else ()
    return modifier.show_viewport and any(node.bl_idname == SURFACE_NODE for node in nodes)


def put_offsets(item, counts, offsets):
    layers = layers_of(item)
    if counts != [len(layer["position"].data) for layer in layers]:
        raise UserError("{name} changed while it was worked on; run again", item)
    motion.written.add(item.session_uid)
    for layer, part in zip(layers, np.split(offsets, np.cumsum(counts)[:-1]), strict=True):
        attribute = layer.get(OFFSETS) or layer.new(OFFSETS, "FLOAT_VECTOR", "POINT")
        mesh_arrays.put_vectors(attribute.data, part)
    item.data.update_tag()


class KeyCarrier(Carrier):
    """Curves, surfaces and lattices: an own shape key on top of the user's."""

    def read(self, context, item):
        refuse_shared(item)
        keys = item.data.shape_keys
        if keys is not None and (not keys.use_relative or item.show_only_shape_key):
            raise UserError("{name} shows one shape key alone, or absolute ones; it is not carried", item)
        self.parts = parts_of(item)
        return own_points(item)

    def bind(self, context, item, entry):
        if item.data.shape_keys is None:
            references.refuse_new(item)
            item.shape_key_add(name="Basis", from_mix=False)
        if own_key(item) is None:
            references.refuse_new(item)
            key = item.shape_key_add(name=WARP_KEY, from_mix=False)
            key.value = 1.0

    def write(self, item, entry, shape):
        key = own_key(item)
        if key is None:
            raise UserError("The shape key of {name} was removed", item)
        if len(shape) != sum(width * count for width, count in parts_of(item)):
            raise UserError("{name} changed while it was worked on; run again", item)
        motion.written.add(item.session_uid)
        put_key(key, key_points(item.data.shape_keys.reference_key) + (shape - self.points))
        item.data.update_tag()

    def snapshot(self, item, entry):
        key = own_key(item)
        return item.data.shape_keys is not None, None if key is None else key_points(key)

    def restore(self, item, entry, before):
        had_keys, points = before
        if points is None:
            drop_key(item, also_basis=not had_keys)
        elif own_key(item) is not None and len(key_points(own_key(item))) == len(points):
            put_key(own_key(item), points)
            item.data.update_tag()

    @staticmethod
    def is_on(item):
        return own_key(item) is not None

    @staticmethod
    def release(item, entry):
        forget_baked_keys(item)
        drop_key(item, also_basis=True)


def own_key(item):
    keys = item.data.shape_keys
    return keys.key_blocks.get(WARP_KEY) if keys is not None else None


def drop_key(item, also_basis):
    """Removes the field's shape key; with `also_basis`, also a Basis that is left alone."""
    if own_key(item) is not None:
        item.shape_key_remove(own_key(item))
    keys = item.data.shape_keys
    if also_basis and keys is not None and len(keys.key_blocks) == 1:
        item.shape_key_clear()


def forget_baked_keys(item):
    """Removes the shape keys that a bake made, with their animation."""
    keys = item.data.shape_keys
    if keys is not None:
        remove_curves(keys, lambda one: one.data_path.startswith(f'key_blocks["{BAKED_KEY}'))
        for key in [key for key in keys.key_blocks if key.name.startswith(BAKED_KEY)]:
            item.shape_key_remove(key)


FIELDS = ("co", "handle_left", "handle_right")  # of a Bézier point


def parts_of(item):
    """[(positions per point, number of points)] of an object's splines; one entry for a lattice."""
    if item.type == "LATTICE":
        return [(1, len(item.data.points))]
    splines = item.data.splines
    return [(3, len(s.bezier_points)) if s.type == "BEZIER" else (1, len(s.points)) for s in splines]


def own_points(item):
    """(n, 3) an object's control points with its shape keys, except the field's."""
    keys = item.data.shape_keys
    if keys is not None:
        points = key_points(keys.reference_key)
        for key in keys.key_blocks[1:]:
            if key.name != WARP_KEY and not key.mute and key.value:
                points = points + key.value * (key_points(key) - key_points(key.relative_key))
        return points
    if item.type == "LATTICE":
        return np.array([point.co_deform for point in item.data.points], dtype=np.float64).reshape(-1, 3)
    points = []
    for spline in item.data.splines:
        if spline.type == "BEZIER":
            points += [getattr(point, field) for point in spline.bezier_points for field in FIELDS]
        else:
            points += [point.co[:3] for point in spline.points]
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def key_points(key):
    """(n, 3) positions of a shape key, including the handles of Bézier points."""
    points = []
    for point in key.data:
        points += [getattr(point, field) for field in FIELDS if hasattr(point, field)]
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def put_key(key, points):
    rows = iter(points.tolist())
    for point in key.data:
        for field in FIELDS:
            if hasattr(point, field):
                setattr(point, field, next(rows))
