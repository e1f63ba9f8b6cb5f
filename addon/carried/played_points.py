# SPDX-License-Identifier: GPL-3.0-or-later
"""Attribute collections with the points of hair curves, point clouds and Grease Pencil."""

import bpy

from ..blender import modifier_stack
from ..blender.references import remove_mesh_object, remove_node_modifier
from ..core.errors import UserError
from ..field_modifier import cache_modifier, inputs
from ..field_modifier.node_group import VECTORS, Graph, kept_group
from ..names import CACHE_MODIFIER, PLAYED_GROUP, PLAYED_SUFFIX, ROWS


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
    inputs.put(modifier, "Points", bpy.data.objects.new(name, mesh))
    if field is not None:
        inputs.put_attribute(modifier, "Mask", inputs.get_attribute(field, "Mask"))
        inputs.put(modifier, "Factor", inputs.get(field, "Factor"))
    item.modifiers.move(len(item.modifiers) - 1, 0)  # hair grown from these follows
    cache_modifier.set_playing(item, True, find(item))
    return inputs.get(modifier, "Points")


def remove(item):
    """Removes the bake from the object; the cache file stays."""
    modifier = find(item)
    if modifier is None:
        return
    cache_modifier.set_playing(item, False, modifier)
    played = inputs.get(modifier, "Points")
    remove_node_modifier(modifier)
    if played is not None and played.users == 0:
        remove_mesh_object(played)
    for layer in layers_of(item):
        if ROWS in layer:
            layer.remove(layer[ROWS])
    item.data.update_tag()
