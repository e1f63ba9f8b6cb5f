# SPDX-License-Identifier: GPL-3.0-or-later
"""What the figures share: objects from shapes, handles from boxes, solving, and sheets of photographs."""

import math
from pathlib import Path
from typing import NamedTuple

import bpy
import creatures
import numpy as np
import stage
from mathutils import Matrix, Vector
from shapes import Shape

import arapfields as af

SAMPLES = 12000


class Box(NamedTuple):
    """A handle: a box at rest, and its motion: a turn (degrees) about `axis` at `pivot`, then a shift."""

    centre: tuple
    half: tuple
    angle: float = 0.0
    axis: str = "Y"
    pivot: tuple | None = None
    shift: tuple = (0.0, 0.0, 0.0)

    @property
    def rest(self):
        return Matrix.LocRotScale(Vector(self.centre), None, Vector(self.half))

    @property
    def target(self):
        pivot = Matrix.Translation(Vector(self.pivot or self.centre))
        turn = Matrix.Rotation(math.radians(self.angle), 4, self.axis)
        return Matrix.Translation(Vector(self.shift)) @ pivot @ turn @ pivot.inverted() @ self.rest

    @property
    def handle(self):
        return af.Cuboid(np.array(self.rest), np.array(self.target))


def samples_of(shape, count=SAMPLES, seed=0):
    return af.sample_mesh(shape.vertices, shape.triangles, count, seed=seed)


def deformed(shape, boxes, samples=None, **options):
    """The field that moves the boxes' parts, and the warped shape."""
    if stage.DRAFT:
        options = {"width": 64, "iterations": 80, "learning_rate": 4e-3, **options}
    handles = [box.handle if isinstance(box, Box) else box for box in boxes]
    samples = samples_of(shape) if samples is None else samples
    field = af.deform(samples, handles, af.DeformOptions(**options))
    return field, warped(shape, field)


def warped(shape, field):
    return shape._replace(vertices=field(shape.vertices))


def add(shape, name, place=None, colour=None, roughness=0.42):
    """A smooth mesh object of the shape in its own colours, or in one."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(shape.vertices.tolist(), [], shape.triangles.tolist())
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    paint = stage.material(name, colour, roughness) if colour else stage.vertex_paint(name, roughness)
    if colour is None:
        attribute = mesh.color_attributes.new("colour", "FLOAT_COLOR", "POINT")
        rgba = np.c_[shape.colours, np.ones(len(shape.vertices))].astype(np.float32)
        attribute.data.foreach_set("color", rgba.ravel())
    mesh.materials.append(paint)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(item)
    item.matrix_world = place or Matrix.Identity(4)
    return item


def add_boxes(boxes, place, targets, edge=0.011):
    """The boxes' edges at rest or at their targets, one colour a handle."""
    drawn = []
    for number, box in enumerate(boxes):
        colour = stage.BOX_COLOURS[number % len(stage.BOX_COLOURS)]
        drawn.append(stage.box(f"box {number}", place @ (box.target if targets else box.rest), colour, edge))
    return drawn


def turned(shape, x, degrees, scale=1.0, y=0.0):
    """Where a shape stands: on the floor, moved along the row and turned about its vertical axis."""
    turn = Matrix.Rotation(math.radians(degrees), 4, "Z")
    lift = -scale * shape.vertices[:, 2].min()
    return Matrix.Translation((x, y, lift)) @ turn @ Matrix.Scale(scale, 4)


def in_column(made, rest, column, degrees, spacing):
    """In its column on the floor, at the scale at which the rest shape fills one: a row has one scale."""
    turn = np.radians(degrees)
    width = np.ptp(rest.vertices[:, :2] @ (np.cos(turn), -np.sin(turn)))
    scale = min(1.8 / width, 1.9 / np.ptp(rest.vertices[:, 2]))
    return turned(made, column * spacing, degrees, scale)


def measured(field):
    """The figures of a solve that captions and pages quote."""
    report = field.report
    names = (
        "stretch",
        "bend",
        "energy",
        "handle_error_mean",
        "min_determinant",
        "flipped_share",
        "preference",
    )
    found = {name: report[name] for name in names if name in report}
    return {name: round(float(value), 5) for name, value in found.items() if value is not None}


def stack(paths, target, gap=6, horizontal=False):
    """Pictures of one width (or height) as one; the parts are removed."""
    from PIL import Image

    parts = [Image.open(path).convert("RGB") for path in paths]
    along = sum(p.width if horizontal else p.height for p in parts) + gap * (len(parts) - 1)
    across = parts[0].height if horizontal else parts[0].width
    sheet = Image.new("RGB", (along, across) if horizontal else (across, along), "white")
    offset = 0
    for part in parts:
        sheet.paste(part, (offset, 0) if horizontal else (0, offset))
        offset += (part.width if horizontal else part.height) + gap
    sheet.save(target, optimize=True)
    for path in paths:
        Path(path).unlink()


def shape(name):
    return creatures.load(name)


def suzanne(levels=2):
    """Blender's monkey, subdivided, in one colour; her triangles as Blender splits her faces."""
    bpy.ops.mesh.primitive_monkey_add()
    item = bpy.context.object
    item.modifiers.new("Subdivision", "SUBSURF").levels = levels
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    mesh = item.data
    mesh.calc_loop_triangles()
    vertices = np.array([vertex.co for vertex in mesh.vertices], float)
    triangles = np.array([triangle.vertices for triangle in mesh.loop_triangles], np.int64)
    bpy.data.objects.remove(item, do_unlink=True)
    return Shape(vertices, triangles, np.tile((0.42, 0.20, 0.08), (len(vertices), 1)))
