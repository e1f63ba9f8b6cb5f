# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group that adds an object's motion to its points; Blender evaluates it without the extension.

The motion is one offset a point, in the object's coordinates: an attribute of the mesh itself, or, where
modifiers before make the points, an attribute of a helper mesh, taken point by point. Where that has another
number of points than the mesh at hand (a render at a higher level of subdivision), it is taken from the
nearest place of the helper's surface instead.
"""

import bpy

from ..blender.modifier_stack import FREE_NORMALS
from ..names import FIELD_GROUP, FIELD_MODIFIER, OFFSETS, TURNS

VERSION = 1
PLAIN = ""  # of the groups: the one that turns no normals; the others are named by the normals' domain


def find_or_make(normals=PLAIN):
    """The group for a mesh whose free custom normals lie on that domain (POINT, FACE, CORNER, or none)."""
    mark = f"{VERSION} {normals}"
    for group in bpy.data.node_groups:
        if group.get(FIELD_GROUP) == mark and group.library is None:
            return group
    group = build(f"{FIELD_MODIFIER} {normals.title()} Normals" if normals else FIELD_MODIFIER, normals)
    group[FIELD_GROUP] = mark
    return group


def build(name, normals):
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group.is_modifier = True
    graph = Graph(group)
    graph.socket("Geometry", "INPUT", "NodeSocketGeometry")
    factor = graph.socket("Factor", "INPUT", "NodeSocketFloat", "How far the points go of the way")
    factor.default_value, factor.min_value, factor.max_value, factor.subtype = 1.0, 0.0, 1.0, "FACTOR"
    mask = graph.socket("Mask", "INPUT", "NodeSocketFloat", "How far each point goes; takes a vertex group")
    mask.default_value, mask.min_value, mask.max_value, mask.subtype = 1.0, 0.0, 1.0, "FACTOR"
    helper = graph.socket("Offsets", "INPUT", "NodeSocketObject", "Mesh that carries the offsets, if any")
    helper.hide_in_modifier = True
    graph.socket("Geometry", "OUTPUT", "NodeSocketGeometry")

    given = graph.node("NodeGroupInput").outputs
    source = AttributeSource(graph, given["Geometry"], given["Offsets"])
    strength = graph.node("ShaderNodeMath", given["Factor"], given["Mask"], operation="MULTIPLY").outputs[0]
    moved = graph.node("ShaderNodeVectorMath", operation="SCALE")
    graph.link(source.vectors(OFFSETS), moved.inputs["Vector"])
    graph.link(strength, moved.inputs["Scale"])
    acts = graph.node("FunctionNodeCompare", data_type="FLOAT", operation="NOT_EQUAL")
    graph.link(strength, acts.inputs["A"])
    acts.inputs["Epsilon"].default_value = 0.0  # elsewhere the points stay bit for bit
    place = graph.node("GeometryNodeSetPosition")
    graph.link(given["Geometry"], place.inputs["Geometry"])
    graph.link(acts.outputs[0], place.inputs["Selection"])
    graph.link(moved.outputs[0], place.inputs["Offset"])
    result = place.outputs[0]
    if normals:
        result = turn_normals(graph, result, source.vectors(TURNS), strength, normals)
    graph.node("NodeGroupOutput", result)
    return group


def turn_normals(graph, geometry, turns, strength, domain):
    """Turns free custom normals about the axis of each turn (axis · angle), by `strength` of its angle."""
    angle = graph.node("ShaderNodeVectorMath", turns, operation="LENGTH").outputs["Value"]
    part = graph.node("ShaderNodeMath", angle, strength, operation="MULTIPLY").outputs[0]
    normal = graph.node("GeometryNodeInputNamedAttribute", FREE_NORMALS, data_type="FLOAT_VECTOR").outputs[0]
    turned = graph.node("ShaderNodeVectorRotate", rotation_type="AXIS_ANGLE")
    for output, name in ((normal, "Vector"), (turns, "Axis"), (part, "Angle")):
        graph.link(output, turned.inputs[name])
    store = graph.node("GeometryNodeSetMeshNormal", mode="FREE", domain=domain)
    graph.link(geometry, store.inputs["Mesh"])
    graph.link(turned.outputs[0], store.inputs["Custom Normal"])
    return store.outputs[0]


class Graph:
    """Makes nodes and links, from left to right."""

    def __init__(self, group):
        self.group, self.count = group, 0

    def socket(self, name, way, kind, description=""):
        made = self.group.interface.new_socket(name, in_out=way, socket_type=kind)
        made.description = description
        return made

    def node(self, kind, *inputs, **settings):
        """A node with these settings, then these outputs or values in its first inputs."""
        made = self.group.nodes.new(kind)
        made.location = 190 * (self.count % 8), -220 * (self.count // 8)
        self.count += 1
        for name, value in settings.items():
            setattr(made, name, value)
        for socket, value in zip(made.inputs, inputs, strict=False):
            if isinstance(value, bpy.types.NodeSocket):
                self.link(value, socket)
            else:
                socket.default_value = value
        return made

    def link(self, output, socket):
        self.group.links.new(output, socket)


class AttributeSource:
    """Attributes of the geometry itself, or of the helper mesh where there is one."""

    def __init__(self, graph, geometry, helper):
        self.graph = graph
        self.helper = graph.node("GeometryNodeObjectInfo", helper).outputs["Geometry"]
        count = graph.node("GeometryNodeAttributeDomainSize", geometry).outputs["Point Count"]
        helpers = graph.node("GeometryNodeAttributeDomainSize", self.helper).outputs["Point Count"]
        self.same = self.compare(count, helpers, "EQUAL")
        self.exists = self.compare(helpers, 0, "GREATER_THAN")

    def compare(self, a, b, operation):
        node = self.graph.node("FunctionNodeCompare", data_type="INT", operation=operation)
        used = [socket for socket in node.inputs if socket.enabled]
        self.graph.link(a, used[0])
        if isinstance(b, int):
            used[1].default_value = b
        else:
            self.graph.link(b, used[1])
        return node.outputs[0]

    def choose(self, condition, otherwise, chosen):
        node = self.graph.node("GeometryNodeSwitch", input_type="VECTOR")
        for name, output in (("Switch", condition), ("False", otherwise), ("True", chosen)):
            self.graph.link(output, node.inputs[name])
        return node.outputs[0]

    def vectors(self, name):
        graph = self.graph
        own = graph.node("GeometryNodeInputNamedAttribute", name, data_type="FLOAT_VECTOR").outputs[0]
        index = graph.node("GeometryNodeSampleIndex", data_type="FLOAT_VECTOR", domain="POINT")
        nearest = graph.node("GeometryNodeSampleNearestSurface", data_type="FLOAT_VECTOR")
        graph.link(graph.node("GeometryNodeInputIndex").outputs[0], index.inputs["Index"])
        for node in (index, nearest):
            graph.link(self.helper, node.inputs[0])
            graph.link(own, node.inputs["Value"])
        of_helper = self.choose(self.same, nearest.outputs["Value"], index.outputs["Value"])
        return self.choose(self.exists, own, of_helper)
