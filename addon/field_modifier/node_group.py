# SPDX-License-Identifier: GPL-3.0-or-later
"""The field's node group, and inputs of a Geometry Nodes modifier by name, the Mask among them."""

import bpy

from ..blender import modifier_stack, property_definitions
from ..blender.modifier_stack import FREE_NORMALS
from ..blender.object_references import settings_of
from ..names import CHANGES, FIELD_GROUP, FIELD_MODIFIER, LAYER_GROUP, OFFSETS, PLAYED_GROUP, TURNS, WARP_KEY

# Inputs of a Geometry Nodes modifier by name, in all versions of Blender, and the Mask among them.

# Inputs of a Geometry Nodes modifier by name, in all supported versions of Blender.


def identifier(modifier, name):
    sockets = modifier.node_group.interface.items_tree
    return next(s.identifier for s in sockets if getattr(s, "in_out", "") == "INPUT" and s.name == name)


def slot(modifier, name):
    """Blender 5.2's property group of an input; None in versions that store inputs as ID properties."""
    inputs = getattr(getattr(modifier, "properties", None), "inputs", None)
    return None if inputs is None else getattr(inputs, identifier(modifier, name))


def get(modifier, name):
    socket = slot(modifier, name)
    return socket.value if socket is not None else modifier[identifier(modifier, name)]


def put(modifier, name, value):
    socket = slot(modifier, name)
    if socket is not None:
        socket.value = value
    else:
        modifier[identifier(modifier, name)] = value
    modifier.id_data.update_tag()


def get_attribute(modifier, name):
    """Name of the attribute or vertex group that an input reads; "" if it is a single value."""
    socket = slot(modifier, name)
    if socket is not None:
        return socket.attribute_name if socket.type == "ATTRIBUTE" else ""
    key = identifier(modifier, name)
    return modifier[f"{key}_attribute_name"] if modifier.get(f"{key}_use_attribute") else ""


def put_attribute(modifier, name, attribute):
    """Sets an input to an attribute or vertex group, or with "" to its single value."""
    socket = slot(modifier, name)
    if socket is not None:
        socket.type = "ATTRIBUTE" if attribute else "VALUE"
        socket.attribute_name = attribute
    else:
        key = identifier(modifier, name)
        modifier[f"{key}_use_attribute"] = bool(attribute)
        modifier[f"{key}_attribute_name"] = attribute
    modifier.id_data.update_tag()


# The Mask of a source's modifiers: a vertex group that scales the motion of each point.


def mask_of(source):
    """Name of the source's mask: the one chosen in the panel, else the one of its field's modifier; or ""."""
    return settings_of(source).stiffness.mask or mask_of_field(source) or ""


def take_mask(source):
    """Sets the mask chosen in the panel, if any, on a new or reused modifier."""
    chosen = settings_of(source).stiffness.mask
    if chosen and mask_of_field(source) != chosen:
        put_mask(source, chosen)


def mask_of_field(source):
    modifier = modifier_stack.find(source)
    return None if modifier is None else get_attribute(modifier, "Mask")


def put_mask(source, group):
    """Sets this group, or with "" none, on the modifiers of the field and of the bake."""
    field, cache = modifier_stack.find(source), modifier_stack.find_cache(source)
    if field is not None:
        put_attribute(field, "Mask", group)
    if cache is not None:
        cache.vertex_group = group if group in source.vertex_groups else ""


def lend_mask(source, item):
    """Sets a carried object's own group with the name of the source's mask as its mask, if it has one."""
    group = mask_of(source)
    if group:
        put_carried_mask(item, group)


def put_carried_mask(item, group):
    """Sets this group, or none, as the mask of a carried object, unless it has a chosen one."""
    if settings_of(item).stiffness.mask:
        return
    group = group if has_mask(item, group) else ""
    if item.type in ("MESH", "CURVES", "POINTCLOUD", "GREASEPENCIL"):
        put_mask(item, group)
    for modifier in item.modifiers:
        if modifier.type == "NODES" and PLAYED_GROUP in (modifier.node_group or ()):
            put_attribute(modifier, "Mask", group)
    keys = item.data.shape_keys if item.type == "LATTICE" else None
    if keys is not None and WARP_KEY in keys.key_blocks:
        keys.key_blocks[WARP_KEY].vertex_group = group


def has_mask(item, group):
    """Whether an object has weights of that name: a vertex group, or a float attribute on hair points."""
    if item.type in ("CURVES", "POINTCLOUD"):
        attribute = item.data.attributes.get(group)
        return attribute is not None and (attribute.domain, attribute.data_type) == ("POINT", "FLOAT")
    return group in item.vertex_groups


def mask_chosen(settings):
    """Update callback of the chosen mask."""
    source = settings.id_data
    put_mask(source, settings.mask)
    for entry in settings_of(source).carried:
        if entry.item is not None and entry.item.library is None:
            put_carried_mask(entry.item, settings.mask)


property_definitions.listeners["mask"] = mask_chosen


# The node group that adds an object's motion to its points; Blender evaluates it without the extension.
#
# The motion is one offset per point, in the object's coordinates: an attribute of the mesh itself, or, if
# earlier modifiers make the points, of a helper mesh, read by index. If the helper has another number of
# points than the geometry (a render at a higher subdivision level), the offset is sampled at the nearest
# point of the helper's surface instead.

VERSION = 1
VECTORS = {"data_type": "FLOAT_VECTOR", "domain": "POINT"}  # settings of nodes that sample points
CHANGE_KINDS = {"QUATERNION": "FLOAT_COLOR"}  # {type of an attribute: type of its change}, if other
PLAIN = ""  # key of the group that rotates no normals; other keys are the normals' domain


def find_or_make(normals=PLAIN, splats=None):
    """The group for a mesh whose free custom normals lie on that domain (POINT, FACE, CORNER, or none).

    `splats`: {attribute: its type} of splats, whose changes it adds.
    """
    name = f"{FIELD_MODIFIER} {normals.title()} Normals" if normals else FIELD_MODIFIER
    name = f"{FIELD_MODIFIER} Splats" if splats else name
    return kept_group(FIELD_GROUP, mark_of(normals, splats), lambda: build(name, normals, splats or {}))


def mark_of(normals, splats):
    return f"{VERSION} {' '.join(splats)}" if splats else f"{VERSION} {normals}"


def is_for(modifier, normals, splats):
    """Whether a field's modifier has the group that find_or_make() gives for these."""
    group = modifier.node_group
    return group.library is None and group[FIELD_GROUP] == mark_of(normals, splats)


def find_or_make_layer(kind, number, normals=PLAIN):
    """The group for a layer, whose motion has its own attribute names."""
    name, mark = f"{FIELD_MODIFIER} {kind.title()}", f"{VERSION} {kind} {number} {normals}"
    return kept_group(LAYER_GROUP, mark, lambda: build(name, normals, {}, number))


def normals_of(modifier):
    """Domain of the free custom normals that a field's modifier rotates, or ""."""
    return "".join(modifier.node_group[FIELD_GROUP].split()[1:])


def names_of(number=""):
    """Attribute names (offsets, rotation vectors) of a motion, with the number of a layer."""
    return (f"{OFFSETS} {number}".rstrip(), f"{TURNS} {number}".rstrip())


def kept_group(key, mark, build):
    """The local node group whose custom property `key` is `mark`; built if missing."""
    for group in list(bpy.data.node_groups):
        if group.get(key) == mark and group.library is None:
            return group
    group = build()
    group[key] = mark
    return group


def build(name, normals, splats, number=""):
    graph, (offsets, turns) = Graph(name), names_of(number)
    graph.fading_inputs("How far each point goes; takes a vertex group")
    helper = graph.socket("Offsets", "INPUT", "NodeSocketObject", "Mesh that carries the offsets, if any")
    helper.hide_in_modifier = True
    graph.socket("Geometry", "OUTPUT", "NodeSocketGeometry")

    inputs = graph.node("NodeGroupInput").outputs
    source = AttributeSource(graph, inputs["Geometry"], inputs["Offsets"])
    strength = graph.node("ShaderNodeMath", inputs["Factor"], inputs["Mask"], operation="MULTIPLY").outputs[0]
    vector = source.vectors(offsets)
    offset = graph.node("ShaderNodeVectorMath", into={"Vector": vector, "Scale": strength}, operation="SCALE")
    result = graph.set_position(inputs["Geometry"], graph.acts(strength), offset.outputs[0])
    if normals:
        result = turn_normals(graph, result, source.vectors(turns), strength, normals)
    for attribute, kind in splats.items():
        result = add_change(graph, result, attribute, kind, strength)
    graph.node("NodeGroupOutput", result)
    return graph.group


def add_change(graph, geometry, attribute, kind, strength):
    """Adds nodes that add an attribute's change, times `strength`, to it."""
    own, change = (
        graph.node("GeometryNodeInputNamedAttribute", name, data_type=data_type).outputs[0]
        for name, data_type in ((attribute, kind), (CHANGES + attribute, CHANGE_KINDS.get(kind, kind)))
    )
    if kind == "QUATERNION":
        changes = graph.node("FunctionNodeSeparateColor", change).outputs
        numbers = graph.node("FunctionNodeRotationToQuaternion", own).outputs
        sums = [graph.scaled_sum(strength, *both) for both in zip(changes, numbers, strict=True)]
        new = graph.node("FunctionNodeQuaternionToRotation", *sums).outputs[0]
    elif kind == "FLOAT":
        new = graph.scaled_sum(strength, change, own)
    else:
        part = graph.node(
            "ShaderNodeVectorMath", into={"Vector": change, "Scale": strength}, operation="SCALE"
        )
        new = graph.node("ShaderNodeVectorMath", own, part.outputs[0], operation="ADD").outputs[0]
    into = {"Geometry": geometry, "Name": attribute, "Value": new}
    return graph.node("GeometryNodeStoreNamedAttribute", into=into, data_type=kind).outputs[0]


def turn_normals(graph, geometry, turns, strength, domain):
    """Adds nodes that rotate free custom normals by rotation vectors (axis · angle), scaled by `strength`."""
    angle = graph.node("ShaderNodeVectorMath", turns, operation="LENGTH").outputs["Value"]
    part = graph.node("ShaderNodeMath", angle, strength, operation="MULTIPLY").outputs[0]
    normal = graph.node("GeometryNodeInputNamedAttribute", FREE_NORMALS, data_type="FLOAT_VECTOR").outputs[0]
    into = {"Vector": normal, "Axis": turns, "Angle": part}
    turned = graph.node("ShaderNodeVectorRotate", into=into, rotation_type="AXIS_ANGLE").outputs[0]
    into = {"Mesh": geometry, "Custom Normal": turned}
    return graph.node("GeometryNodeSetMeshNormal", into=into, mode="FREE", domain=domain).outputs[0]


class Graph:
    """A new node group with geometry input and output; makes nodes and links, from left to right."""

    def __init__(self, name):
        self.group, self.count = bpy.data.node_groups.new(name, "GeometryNodeTree"), 0
        self.group.is_modifier = False  # keeps it out of the Add Modifier menu, where it has no effect
        self.socket("Geometry", "INPUT", "NodeSocketGeometry")

    def socket(self, name, way, kind, description=""):
        socket = self.group.interface.new_socket(name, in_out=way, socket_type=kind)
        socket.description = description
        return socket

    def fading_inputs(self, mask):
        """Factor and Mask, each from 0 to 1; `mask` is the latter's tooltip."""
        for name, text in (("Factor", "How far the points go of the way"), ("Mask", mask)):
            one = self.socket(name, "INPUT", "NodeSocketFloat", text)
            one.default_value, one.min_value, one.max_value, one.subtype = 1.0, 0.0, 1.0, "FACTOR"

    def node(self, kind, *inputs, into=(), **settings):
        """A node with these settings, and these outputs or values in its first inputs, or in named ones."""
        node = self.group.nodes.new(kind)
        node.location = 190 * (self.count % 8), -220 * (self.count // 8)
        self.count += 1
        for name, value in settings.items():
            setattr(node, name, value)
        named = [(node.inputs[name], value) for name, value in dict(into).items()]
        for socket, value in [*zip(node.inputs, inputs, strict=False), *named]:
            self.put(socket, value)
        return node

    def put(self, socket, value):
        """Sets an input's value, or links an output to it."""
        if isinstance(value, bpy.types.NodeSocket):
            self.group.links.new(value, socket)
        else:
            socket.default_value = value

    def scaled_sum(self, factor, change, number):
        return self.node("ShaderNodeMath", factor, change, number, operation="MULTIPLY_ADD").outputs[0]

    def acts(self, strength):
        """Selection of points with a strength other than 0; the others stay bit for bit."""
        into = {"A": strength, "Epsilon": 0.0}
        return self.node("FunctionNodeCompare", into=into, data_type="FLOAT", operation="NOT_EQUAL").outputs[
            0
        ]

    def set_position(self, geometry, selection, offset):
        into = {"Geometry": geometry, "Selection": selection, "Offset": offset}
        return self.node("GeometryNodeSetPosition", into=into).outputs[0]


class AttributeSource:
    """Attributes of the geometry itself, or of the helper mesh if there is one."""

    def __init__(self, graph, geometry, helper):
        self.graph = graph
        self.helper = graph.node("GeometryNodeObjectInfo", helper).outputs["Geometry"]
        count = graph.node("GeometryNodeAttributeDomainSize", geometry).outputs["Point Count"]
        helpers = graph.node("GeometryNodeAttributeDomainSize", self.helper).outputs["Point Count"]
        self.same = self.compare(count, helpers, "EQUAL")
        self.exists = self.compare(helpers, 0, "GREATER_THAN")

    def compare(self, a, b, operation):
        node = self.graph.node("FunctionNodeCompare", data_type="INT", operation=operation)
        enabled = [socket for socket in node.inputs if socket.enabled]
        for socket, value in zip(enabled, (a, b), strict=False):
            self.graph.put(socket, value)
        return node.outputs[0]

    def choose(self, condition, otherwise, chosen):
        into = {"Switch": condition, "False": otherwise, "True": chosen}
        return self.graph.node("GeometryNodeSwitch", into=into, input_type="VECTOR").outputs[0]

    def vectors(self, name):
        graph = self.graph
        own = graph.node("GeometryNodeInputNamedAttribute", name, data_type="FLOAT_VECTOR").outputs[0]
        index = graph.node("GeometryNodeSampleIndex", self.helper, into={"Value": own}, **VECTORS)
        nearest = graph.node(
            "GeometryNodeSampleNearestSurface", self.helper, into={"Value": own}, data_type="FLOAT_VECTOR"
        )
        graph.put(index.inputs["Index"], graph.node("GeometryNodeInputIndex").outputs[0])
        of_helper = self.choose(self.same, nearest.outputs["Value"], index.outputs["Value"])
        return self.choose(self.exists, own, of_helper)
