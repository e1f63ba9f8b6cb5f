# SPDX-License-Identifier: GPL-3.0-or-later
"""The data of a wrapped mesh to transfer, read at once; nothing is written meanwhile."""

from dataclasses import dataclass

import numpy as np

from ..blender import mesh_arrays, modifier_stack, vertex_groups
from ..core.errors import UserError
from ..core.geometry.spaces import facing, mirrors
from ..names import OFFSETS, TURNS
from . import keys

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
        values = keys.since_wrapped(source)
        if values is not None:
            before, stack = modifier_stack.before(source, in_place=True), list(source.modifiers)
            self.rest = keys.shape_at(context, source, before, values)
            through = stack[: modifier_stack.place(source) + 1]
            self.moved = keys.shape_at(context, source, through, values)
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
