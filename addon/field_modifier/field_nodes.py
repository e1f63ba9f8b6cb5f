# SPDX-License-Identifier: GPL-3.0-or-later
"""The field as Geometry Nodes of the user's own: the node group, and the helper that samples it."""

import bpy
import numpy as np
from mathutils import Matrix

from ..blender.object_references import ObjectReference, settings_of
from ..core.errors import UserError
from ..core.geometry.spaces import inverse
from ..core.runtime import native
from ..names import FIELD_NODES, FIELD_SUFFIX
from .node_group import Graph, kept_group

# Nodes by what they compute, and those that read the rows of a helper mesh.

AFFINE, KERNEL, NODE, PLACE, FRAME = range(5)  # parts of the rows; FRAME: where the cube is
PART, SCALE, MOVE, INSIDE, MAP = "part", "scale", "move", "inside", "map"  # attributes of the rows
TYPES = {SCALE: "FLOAT", MOVE: "FLOAT_VECTOR", INSIDE: "FLOAT_VECTOR", MAP: "FLOAT4X4"}


class Nodes(Graph):
    """Further nodes by what they compute."""

    def math(self, operation, *values):
        return self.node("ShaderNodeMath", *values, operation=operation).outputs[0]

    def vector(self, operation, *values):
        node = self.node("ShaderNodeVectorMath", operation=operation)
        enabled = [socket for socket in node.inputs if socket.enabled]
        for socket, value in zip(enabled, values, strict=True):
            self.put(socket, value)
        return next(socket for socket in node.outputs if socket.enabled)

    def exceeds(self, value, limit):
        return self.math("GREATER_THAN", value, limit + 0.5)

    def switch(self, condition, otherwise, chosen):
        into = {"Switch": condition, "False": otherwise, "True": chosen}
        return self.node("GeometryNodeSwitch", into=into, input_type="GEOMETRY").outputs[0]

    def size(self, geometry, component="MESH", name="Point Count"):
        return self.node("GeometryNodeAttributeDomainSize", geometry, component=component).outputs[name]

    def sample(self, geometry, value, index, data_type, domain="POINT"):
        into = {"Value": value, "Index": index}
        node = self.node("GeometryNodeSampleIndex", geometry, into=into, data_type=data_type, domain=domain)
        return node.outputs[0]

    def attribute(self, name, data_type):
        return self.node("GeometryNodeInputNamedAttribute", name, data_type=data_type).outputs[0]

    def moved_points(self, count, place, shift):
        """Points at `place` with their displacement `shift` as an attribute."""
        points = self.node("GeometryNodePoints", count, place).outputs[0]
        into = {"Name": MOVE, "Value": shift}
        return self.node(
            "GeometryNodeStoreNamedAttribute", points, into=into, data_type="FLOAT_VECTOR"
        ).outputs[0]

    def shift_of(self, points, index):
        return self.sample(points, self.attribute(MOVE, "FLOAT_VECTOR"), index, "FLOAT_VECTOR")

    def repeat(self, count, start, add):
        """Repeat zone: values after `count` calls of add(index, values); `start`: [(type, first value)]."""
        first, last = (self.node(f"GeometryNodeRepeat{way}") for way in ("Input", "Output"))
        first.pair_with_output(last)
        last.repeat_items.clear()
        names = [str(number) for number in range(1 + len(start))]  # 0 counts: Blender 4.2 does not tell
        self.put(first.inputs["Iterations"], count)
        for name, (kind, value) in zip(names, [("INT", 0), *start], strict=True):
            last.repeat_items.new(kind, name)
            self.put(first.inputs[name], value)
        index, *values = [first.outputs[name] for name in names]
        after = [self.math("ADD", index, 1.0), *add(index, values)]
        for name, value in zip(names, after, strict=True):
            self.put(last.inputs[name], value)
        return [last.outputs[name] for name in names[1:]]


class Rows:
    """One part of the helper's rows."""

    def __init__(self, graph, rows, part):
        self.graph = graph
        is_part = graph.math("COMPARE", graph.attribute(PART, "INT"), float(part), 0.5)
        self.rows = graph.node("GeometryNodeSeparateGeometry", rows, is_part).outputs[0]
        self.count = graph.size(self.rows)

    def row(self, index):
        return Row(self, index)

    def repeat(self, start, add):
        return self.graph.repeat(self.count, start, lambda index, values: add(self.row(index), values))


class Row:
    """Attributes of one row."""

    def __init__(self, rows, index):
        self.rows, self.index = rows, index

    def __getitem__(self, name):
        graph, kind = self.rows.graph, TYPES[name]
        return graph.sample(self.rows.rows, graph.attribute(name, kind), self.index, kind)

    @property
    def position(self):
        graph = self.rows.graph
        value = graph.node("GeometryNodeInputPosition").outputs[0]
        return graph.sample(self.rows.rows, value, self.index, "FLOAT_VECTOR")


# The node group "ARAP Field": it evaluates a radial field, whose numbers are rows of a helper mesh.
#
# f(x) = x + m(x) (affine part + Σ move · (1 + scale · s)₊⁶), with s the squared distance to a kernel, also
# in the embedding ψ where distances are interior. Sums run over rows by Repeat zones, as one function of a
# place. All is in the cube of the field, which is the helper's space, and rounds little: single precision
# is enough.

VERSION = 1
STEP = 0.01  # step of finite differences for instance rotations, in half cube sides
TURNS = 6  # Newton iterations to the closest rotation: quadratic convergence


def find_or_make():
    return kept_group(FIELD_NODES, str(VERSION), build)


def build():
    graph = Nodes("ARAP Field")
    graph.group.is_modifier = True
    graph.socket(
        "Field", "INPUT", "NodeSocketObject", "What Field as Nodes made: the field's numbers and place"
    )
    graph.fading_inputs("How far each point goes; takes a vertex group or attribute")
    graph.socket("Realize Instances", "INPUT", "NodeSocketBool", "Bend instances; else each moves as a whole")
    graph.socket("Geometry", "OUTPUT", "NodeSocketGeometry")
    graph.group.asset_mark()
    about = graph.group.asset_data
    about.description, about.license = "Moves any geometry by a field of ARAP Fields", "CC0"
    about.author = about.copyright = "ARAP Fields"

    inputs = graph.node("NodeGroupInput").outputs
    space = graph.node("GeometryNodeObjectInfo", inputs["Field"], transform_space="RELATIVE").outputs[
        "Transform"
    ]
    rows = graph.node("GeometryNodeObjectInfo", inputs["Field"]).outputs["Geometry"]
    shift = displacement(graph, rows, space)
    strength = graph.math("MULTIPLY", inputs["Factor"], inputs["Mask"])
    strength = graph.math("MULTIPLY", strength, graph.exceeds(graph.size(rows), 0))
    acts, faded = graph.acts(strength), graph.vector("SCALE", shift, strength)

    before = graph.switch(
        inputs["Realize Instances"],
        inputs["Geometry"],
        graph.node("GeometryNodeRealizeInstances", inputs["Geometry"]).outputs[0],
    )
    after = graph.set_position(before, acts, faded)
    count = graph.size(before, "INSTANCES", "Instance Count")
    turned = turn_instances(graph, before, count, after, acts, strength, shift, space)
    after = graph.switch(graph.exceeds(count, 0), after, turned)
    curves = graph.node("GeometryNodeSeparateComponents", before).outputs["Curve"]
    has_handles = graph.node("GeometryNodeInputNamedAttribute", "handle_left", data_type="FLOAT_VECTOR")
    has_handles = graph.sample(curves, has_handles.outputs["Exists"], 0, "BOOLEAN")
    handles = move_handles(graph, curves, after, acts, strength, shift)
    graph.node("NodeGroupOutput", graph.switch(has_handles, after, handles))
    return graph.group


def displacement(graph, rows, space):
    """f(x) − x at the position of whatever evaluates it, in the coordinates of the modified object."""
    position = graph.node("GeometryNodeInputPosition").outputs[0]
    to_cube = graph.node("FunctionNodeInvertMatrix", space).outputs[0]
    place = graph.node("FunctionNodeTransformPoint", position, to_cube).outputs[0]
    affine, kernels, nodes, places = (Rows(graph, rows, part) for part in range(4))
    inside = embedding(graph, nodes, place)

    def square(row):
        arm, way = (graph.vector("SUBTRACT", a, b) for a, b in ((place, row.position), (inside, row[INSIDE])))
        square = graph.vector("DOT_PRODUCT", arm, arm)
        return graph.math(
            "MULTIPLY", row[SCALE], graph.math("ADD", square, graph.vector("DOT_PRODUCT", way, way))
        )

    def add_kernel(row, sums):
        """(1 + n)³ as 1 + n (3 + n (3 + n)) is rounded once near 1, where a power would be six times."""
        n = graph.math("MAXIMUM", square(row), -1.0)
        cubed = graph.math("MULTIPLY_ADD", n, graph.math("ADD", n, 3.0), 3.0)
        cubed = graph.math("MULTIPLY_ADD", n, cubed, 1.0)
        return [graph.vector("MULTIPLY_ADD", row[MOVE], graph.math("MULTIPLY", cubed, cubed), sums[0])]

    def leave(row, rest):
        """What is left of 1 − m; 1 beyond the reach of the place."""
        way = graph.math("SUBTRACT", graph.math("MULTIPLY", graph.math("SQRT", square(row)), 2.0), 1.0)
        t = graph.node("ShaderNodeClamp", way).outputs[0]
        sums = -20.0
        for constant in (70.0, -84.0, 35.0):
            sums = graph.math("MULTIPLY_ADD", t, sums, constant)
        fourth = graph.math("MULTIPLY", graph.math("MULTIPLY", t, t), graph.math("MULTIPLY", t, t))
        return [graph.math("MULTIPLY", rest[0], graph.math("MULTIPLY", fourth, sums))]

    start = graph.node("FunctionNodeTransformPoint", place, affine.row(0)[MAP]).outputs[0]
    (moved,) = kernels.repeat([("VECTOR", start)], add_kernel)
    (rest,) = places.repeat([("FLOAT", graph.exceeds(places.count, 0))], leave)
    moved = graph.vector("SCALE", moved, graph.math("SUBTRACT", 1.0, rest))
    return graph.node("FunctionNodeTransformDirection", moved, space).outputs[0]


def embedding(graph, nodes, place):
    """ψ: planes about nodes, blended by their Gaussians; 0 where there are no nodes."""
    near = graph.node("GeometryNodeProximity", nodes.rows, target_element="POINTS")
    graph.put(near.inputs["Sample Position"], place)
    near = graph.math("MULTIPLY", near.outputs["Distance"], near.outputs["Distance"])

    def add(row, sums):
        arm = graph.vector("SUBTRACT", place, row.position)
        farther = graph.math("SUBTRACT", near, graph.vector("DOT_PRODUCT", arm, arm))
        weight = graph.math("EXPONENT", graph.math("MULTIPLY", farther, row[SCALE]))
        plane = graph.node("FunctionNodeTransformPoint", place, row[MAP]).outputs[0]
        return [graph.vector("MULTIPLY_ADD", plane, weight, sums[0]), graph.math("ADD", weight, sums[1])]

    planes, weights = nodes.repeat([("VECTOR", (0.0, 0.0, 0.0)), ("FLOAT", 0.0)], add)
    return graph.vector("DIVIDE", planes, weights)


def turn_instances(graph, before, count, after, acts, strength, shift, space):
    """Rotates instances by the rotation closest to f's Jacobian, by finite differences."""
    position = graph.node("GeometryNodeInputPosition").outputs[0]
    step = graph.node("FunctionNodeTransformDirection", (STEP, 0.0, 0.0), space).outputs[0]
    step = graph.vector("LENGTH", step)
    index = graph.node("GeometryNodeInputIndex").outputs[0]
    number, axis = graph.math("MODULO", index, 6.0), graph.math("MODULO", index, 3.0)
    side = graph.math("SUBTRACT", 1.0, graph.math("MULTIPLY", 2.0, graph.exceeds(number, 2)))
    ahead = [graph.math("COMPARE", axis, float(k), 0.5) for k in range(3)]
    ahead = graph.node("ShaderNodeCombineXYZ", *ahead).outputs[0]
    of_instance = graph.math("FLOOR", graph.math("DIVIDE", index, 6.0))
    start = graph.sample(before, position, of_instance, "FLOAT_VECTOR", domain="INSTANCE")
    place = graph.vector("MULTIPLY_ADD", ahead, graph.math("MULTIPLY", side, step), start)
    shifts = graph.moved_points(graph.math("MULTIPLY", count, 6.0), place, shift)

    columns = []
    for k in range(3):
        first = graph.math("MULTIPLY_ADD", index, 6.0, float(k))
        low = graph.math("ADD", first, 3.0)
        difference = graph.vector("SUBTRACT", *(graph.shift_of(shifts, which) for which in (first, low)))
        slope = graph.vector("SCALE", difference, graph.math("DIVIDE", 0.5, step))
        columns.append(graph.vector("ADD", slope, tuple(float(k == i) for i in range(3))))

    def nearer(_, columns):
        """The mean of a matrix and its inverse transposed (Higham's iteration)."""
        crossed = [
            graph.vector("CROSS_PRODUCT", columns[(k + 1) % 3], columns[(k + 2) % 3]) for k in range(3)
        ]
        inverse = graph.math("DIVIDE", 1.0, graph.vector("DOT_PRODUCT", columns[0], crossed[0]))
        sums = [graph.vector("MULTIPLY_ADD", crossed[k], inverse, columns[k]) for k in range(3)]
        return [graph.vector("SCALE", total, 0.5) for total in sums]

    columns = graph.repeat(TURNS, [("VECTOR", column) for column in columns], nearer)
    entries = [
        entry for column in columns for entry in (*graph.node("ShaderNodeSeparateXYZ", column).outputs, 0.0)
    ]
    matrix = graph.node("FunctionNodeCombineMatrix", *entries, 0.0, 0.0, 0.0, 1.0).outputs[0]
    turn = graph.node("FunctionNodeSeparateTransform", matrix).outputs["Rotation"]
    axis, angle = graph.node("FunctionNodeRotationToAxisAngle", turn).outputs
    turn = graph.node(
        "FunctionNodeAxisAngleToRotation", axis, graph.math("MULTIPLY", angle, strength)
    ).outputs[0]
    into = {"Selection": acts, "Rotation": turn, "Pivot Point": position, "Local Space": False}
    return graph.node("GeometryNodeRotateInstances", after, into=into).outputs[0]


def move_handles(graph, curves, after, acts, strength, shift):
    """Moves free and aligned handles of Bézier curves by f; automatic ones follow from the points."""
    count, index = graph.size(curves, "CURVE"), graph.node("GeometryNodeInputIndex").outputs[0]
    places = graph.node("GeometryNodeInputCurveHandlePositions").outputs
    for side, place in zip(("LEFT", "RIGHT"), places, strict=True):
        kinds = [
            graph.node("GeometryNodeCurveHandleTypeSelection", handle_type=kind, mode={side}).outputs[0]
            for kind in ("FREE", "ALIGN")
        ]
        kind = graph.node("FunctionNodeBooleanMath", *kinds, operation="OR").outputs[0]
        kind = graph.node("FunctionNodeBooleanMath", kind, acts, operation="AND").outputs[0]
        start = graph.sample(curves, place, index, "FLOAT_VECTOR")
        shifts = graph.moved_points(count, start, shift)
        there = graph.vector("MULTIPLY_ADD", graph.shift_of(shifts, index), strength, start)
        node = graph.node("GeometryNodeSetCurveHandlePositions", after, kind, there, mode=side)
        after = node.outputs[0]
    return after


# The helper of the node group: a mesh in no scene whose vertices are the numbers of a radial field.
#
# It is a child of the object that the field deforms, and its space is the field's cube: the field stands
# where that object stands.


def rows_of(field, local_to_solve, strength=1.0):
    """(n, 27) single precision, a row for each number of columns: part, place, scale, move, inside, map."""
    if not isinstance(field, native.library().RadialField):
        raise UserError("Nodes know the method Fast alone, without Exact Handles or a wrap")
    arrays = field.arrays()
    if "fine_nodes" in arrays:
        raise UserError(
            "Nodes do not know fine parts such as the fingers of this shape; the extension moves it"
        )
    affine = strength * (arrays["affine"] - np.eye(4, 3, -1))
    scale, inside = -1.0 / (6.0 * arrays["radii"] ** 2), arrays.get("embedded", 0.0)
    moves = strength * arrays["coefficients"]
    kernels = rows(KERNEL, arrays["centers"], scale, moves, inside)
    parts = [
        rows(FRAME, np.zeros((1, 3)), map=columns_of(matrix_of(field, local_to_solve))),
        rows(AFFINE, np.zeros((1, 3)), map=affine_map(affine[1:].T, affine[0])),
        kernels[np.argsort(-np.abs(moves).max(axis=1), kind="stable")],  # so sums round least
    ]
    if "nodes" in arrays:
        slopes = arrays["slopes"].reshape(-1, 3, 3)
        values = arrays["values"] - np.einsum("nki,ni->nk", slopes, arrays["nodes"])
        scale = 1.0 / arrays["width"] ** 2
        parts.append(rows(NODE, arrays["nodes"], scale, map=affine_map(slopes, values)))
    if "places" in arrays:
        inside = arrays.get("embedded_places", 0.0)
        parts.append(rows(PLACE, arrays["places"], 1.0 / arrays["reaches"] ** 2, inside=inside))
    return np.concatenate(parts)


ATTRIBUTES = {  # of the helper's vertices: type, name of a value, columns of the rows
    PART: ("INT", "value", slice(0, 1)),
    "position": ("FLOAT_VECTOR", "vector", slice(1, 4)),
    SCALE: ("FLOAT", "value", slice(4, 5)),
    MOVE: ("FLOAT_VECTOR", "vector", slice(5, 8)),
    INSIDE: ("FLOAT_VECTOR", "vector", slice(8, 11)),
    MAP: ("FLOAT4X4", "value", slice(11, 27)),
}


def rows(part, places, scale=0.0, move=0.0, inside=0.0, map=0.0):
    """Rows of one part."""
    result = np.zeros((len(places), 27), dtype=np.float32)
    result[:, 0], result[:, 1:4], result[:, 4] = part, places, scale
    result[:, 5:8], result[:, 8:11], result[:, 11:] = move, inside, map
    return result


def affine_map(linear, constant):
    """(…, 16) x ↦ linear · x + constant."""
    matrix = np.zeros((*np.shape(linear)[:-2], 4, 4))
    matrix[..., :3, :3], matrix[..., :3, 3], matrix[..., 3, 3] = linear, constant, 1.0
    return columns_of(matrix)


def columns_of(matrix):
    """(…, 16) one column of the matrix after the other, as Blender stores it."""
    return np.swapaxes(matrix, -1, -2).reshape(*np.shape(matrix)[:-2], 16)


def matrix_of(field, local_to_solve):
    """(4, 4) the field's unit cube → local coordinates of its source."""
    to_solve = np.diag([*[field.frame.scale] * 3, 1.0])
    to_solve[:3, 3] = field.frame.center
    return inverse(local_to_solve) @ to_solve


def of(source):
    """The source's own helper, or None; a duplicate's property points to the original's helper."""
    helper = settings_of(source).field_helper
    return helper if helper is not None and helper.parent == source and helper.library is None else None


def make(source):
    mesh = bpy.data.meshes.new(f"{source.name}{FIELD_SUFFIX}")
    helper = bpy.data.objects.new(mesh.name, mesh)
    helper.parent, settings_of(source).field_helper = source, helper
    return helper


def write(helper, values):
    """Puts a field's rows on its helper; none: it moves nothing."""
    mesh = helper.data
    if len(mesh.vertices) != len(values):
        mesh.clear_geometry()
        mesh.vertices.add(len(values))
    for name, (kind, key, columns) in ATTRIBUTES.items():
        attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, "POINT")
        part = np.ascontiguousarray(values[:, columns], dtype=np.int32 if kind == "INT" else np.float32)
        attribute.data.foreach_set(key, part.ravel())
    for row in values[values[:, 0] == FRAME]:
        helper.matrix_parent_inverse = Matrix(row[ATTRIBUTES[MAP][2]].reshape(4, 4)).transposed()
    mesh.update()
    mesh.update_tag()
    helper.update_tag()


def read(helper):
    """The rows as write() takes them."""
    mesh = helper.data
    values = np.zeros((len(mesh.vertices), 27), dtype=np.float32)
    for name, (kind, key, columns) in ATTRIBUTES.items():
        if name in mesh.attributes:
            part = np.empty(values[:, columns].size, dtype=np.int32 if kind == "INT" else np.float32)
            mesh.attributes[name].data.foreach_get(key, part)
            values[:, columns] = part.reshape(values[:, columns].shape)
    return values


def clear(source):
    """Empties the source's helper, so that followers do not move."""
    if of(source) is not None:
        write(of(source), np.zeros((0, 27)))


class Follower:
    """The helper of a source during a run, in the place of a carried object."""

    def __init__(self, source):
        self.reference, self.uid = ObjectReference(of(source)), of(source).session_uid

    def read(self):
        return read(self.reference.find())

    def write(self, values):
        helper = self.reference.find()
        if helper is not None:
            write(helper, values)
