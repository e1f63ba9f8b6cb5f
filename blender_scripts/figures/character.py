# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's mesh, three materials and a UV checker, deformed and stylized: all of it stays where it was."""

import bpy
import numpy as np
import stage
from mathutils import Matrix

import arapfields as af

from .common import Box, add_boxes, measured
from .styles import OPTIONS

SPACING = 3.0
BOXES = [
    Box((0.0, -0.30, -0.50), (0.58, 0.75, 0.52)),
    Box((1.13, 0.32, 0.17), (0.27, 0.34, 0.37), -60, "Y", (0.80, 0.0, 0.20)),
    Box((-1.13, 0.32, 0.17), (0.27, 0.34, 0.37), 60, "Y", (-0.80, 0.0, 0.20)),
]


def checker(name, one, two, scale=24.0):
    """A material that shows the UV map as a checkerboard."""
    made = stage.material(name, one)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    board, uv = nodes.new("ShaderNodeTexChecker"), nodes.new("ShaderNodeUVMap")
    board.inputs["Color1"].default_value, board.inputs["Color2"].default_value = (*one, 1), (*two, 1)
    board.inputs["Scale"].default_value = scale
    links.new(uv.outputs["UV"], board.inputs["Vector"])
    links.new(board.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
    return made


def character():
    """Suzanne, subdivided for good, with materials for face, ears and eyes by loose part and place."""
    bpy.ops.mesh.primitive_monkey_add()
    item = bpy.context.object
    item.modifiers.new("Subdivision", "SUBSURF").levels = 3
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    mesh = item.data
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    for made in (
        checker("face", (0.55, 0.30, 0.14), (0.68, 0.42, 0.22)),
        checker("ears", (0.60, 0.12, 0.12), (0.78, 0.30, 0.24)),
        checker("muzzle", (0.82, 0.66, 0.45), (0.90, 0.78, 0.60)),
        stage.material("eyes", (0.02, 0.02, 0.03), roughness=0.15),
    ):
        mesh.materials.append(made)
    centres = np.array([p.center for p in mesh.polygons])
    ears = np.abs(centres[:, 0]) > 0.86
    muzzle = (centres[:, 2] < -0.02) & (centres[:, 1] < -0.42) & (np.abs(centres[:, 0]) < 0.62)
    index = np.where(ears, 1, np.where(muzzle, 2, 0))
    index[in_eyes(mesh)] = 3
    mesh.polygons.foreach_set("material_index", index.astype(np.int32))
    return item


def in_eyes(mesh):
    """Faces of the two loose parts that are not the head."""
    parent = np.arange(len(mesh.vertices))
    edges = np.array([edge.vertices for edge in mesh.edges])
    while True:
        low = np.minimum(parent[edges[:, 0]], parent[edges[:, 1]])
        before = parent.copy()
        np.minimum.at(parent, edges[:, 0], low)
        np.minimum.at(parent, edges[:, 1], low)
        parent = parent[parent]
        if (parent == before).all():
            break
    first = np.array([face.vertices[0] for face in mesh.polygons])
    sizes = np.bincount(parent)
    return parent[first] != sizes.argmax()


def arrays(mesh):
    vertices = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", vertices)
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def copy_with(item, vertices, column):
    """A copy of the object whose vertices were moved, and nothing else."""
    made = item.copy()
    made.data = item.data.copy()
    made.data.vertices.foreach_set("co", np.ascontiguousarray(vertices, np.float32).ravel())
    made.data.update()
    bpy.context.collection.objects.link(made)
    made.matrix_world = Matrix.Translation((SPACING * column, 0, 0))
    return made


def kept(item, other):
    """Whether UVs and material indices are equal to the last bit."""
    pairs = []
    for mesh in (item.data, other.data):
        uv = np.empty(2 * len(mesh.loops), np.float32)
        mesh.uv_layers.active.data.foreach_get("uv", uv)
        index = np.empty(len(mesh.polygons), np.int32)
        mesh.polygons.foreach_get("material_index", index)
        pairs.append((uv, index))
    return all(np.array_equal(a, b) for a, b in zip(*pairs, strict=True))


def render(output):
    stage.clear()
    item = character()
    vertices, triangles = arrays(item.data)
    samples = af.sample_mesh(vertices, triangles, 12000)
    field = af.deform(
        samples, [box.handle for box in BOXES], af.DeformOptions(iterations=60 if stage.DRAFT else 300)
    )
    live = af.LiveDeformer(samples, options=af.LiveOptions(**OPTIONS))
    live.set_style("cube", 0.6)
    cubic = live.solve()
    shown = [item, copy_with(item, field(vertices), 1), copy_with(item, cubic(vertices), 2)]
    for column, targets in ((0, False), (1, True)):
        shown += add_boxes(BOXES, Matrix.Translation((SPACING * column, 0, 0)), targets)
    stage.photograph(shown, output / "character.png", elevation=8)
    return {
        "deformed": measured(field),
        "stylized": {"preference": round(live.report.preference, 3)},
        "uv_and_materials_equal": kept(item, shown[1]) and kept(item, shown[2]),
    }
