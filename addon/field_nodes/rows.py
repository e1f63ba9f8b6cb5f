# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes by what they compute, and those that read the rows of a helper mesh."""

from ..field_modifier.node_group import Graph

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
