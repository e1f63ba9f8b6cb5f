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
from mathutils.kdtree import KDTree
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


# Shapes as Gaussian splats, and pictures of splats, without a surface: Zwicker et al. 2001, in NumPy.

THICKNESS = 0.08  # of a splat across the surface, as a share of its width along it
SPREAD = 0.72  # of a splat's width, over the distance of its neighbours
BAND = 0.28209479177387814  # the harmonic of band 0
LIGHT = np.array([0.35, -0.55, 0.75]) / np.linalg.norm([0.35, -0.55, 0.75])
SEEN = 3.0  # standard deviations that are drawn


def splats_of_surface(shape, count, seed=0):
    """So many flat, oblong splats on a shape, with its colours and the light that falls on it."""
    samples, rng = (
        af.sample_mesh(shape.vertices, shape.triangles, count, seed=seed),
        np.random.default_rng(seed),
    )
    tree = KDTree(len(shape.vertices))
    for place, vertex in enumerate(shape.vertices):
        tree.insert(vertex, place)
    tree.balance()
    nearest = [tree.find(point)[1] for point in samples.points]
    area = np.linalg.norm(
        np.cross(*np.diff(shape.vertices[shape.triangles], axis=1).swapaxes(0, 1)), axis=1
    ).sum()
    width = SPREAD * np.sqrt(area / 2 / count)
    normals = np.asarray(samples.normals)
    first = np.cross(normals, rng.normal(size=normals.shape))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([normals, first, np.cross(normals, first)], axis=2)
    scales = width * np.array([THICKNESS, 1.35, 0.8]) * rng.uniform(0.8, 1.2, (count, 1))
    shade = 0.35 + 0.65 * np.maximum(normals @ LIGHT, 0)
    colours = (shape.colours[nearest] * shade[:, None]) ** (1 / 2.2)
    harmonics = ((colours - 0.5) / BAND)[:, None, :]
    return af.GaussianSplats(samples.points, quaternions(axes), scales, np.full(count, 0.95), harmonics)


def quaternions(axes):
    """(n, 4) w, x, y, z of rotations (n, 3, 3)."""
    products = np.empty((len(axes), 4, 4))  # of the quaternion with itself, four times
    m = axes
    diagonal = [m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]]
    signs = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    for k in range(4):
        products[:, k, k] = 1 + sum(s * d for s, d in zip(signs[k], diagonal, strict=True))
    for i, (a, b) in enumerate([(2, 1), (0, 2), (1, 0)], 1):
        products[:, 0, i] = products[:, i, 0] = m[:, a, b] - m[:, b, a]
    for i, j in ((1, 2), (1, 3), (2, 3)):
        products[:, i, j] = products[:, j, i] = m[:, i - 1, j - 1] + m[:, j - 1, i - 1]
    best = np.argmax(np.einsum("nkk->nk", products), axis=1)
    rows = products[np.arange(len(m)), best]
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def rotations(turns):
    """(n, 3, 3) of unit quaternions."""
    w, v = turns[:, :1, None], turns[:, None, 1:]
    cross = np.cross(np.broadcast_to(np.eye(3), (len(turns), 3, 3)), turns[:, None, 1:])
    return (2 * w * w - 1) * np.eye(3) + 2 * v * v.swapaxes(1, 2) - 2 * w * cross


def splat_picture(splats, eye, target, size, focal=2.4, ground=None):
    """(height, width, 3) bytes on white; `ground`: a height at which a soft shadow lies."""
    width, height = size
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    turn = np.array([right, np.cross(right, forward), -forward])
    image, left = np.zeros((height, width, 3), np.float32), np.ones((height, width), np.float32)
    scales, turns = np.asarray(splats.scales, float), np.asarray(splats.rotations, float)
    spread = rotations(turns) * scales[:, None, :]
    centers = np.asarray(splats.centers, float)
    colours = np.clip(0.5 + BAND * np.asarray(splats.harmonics, float)[:, 0], 0, 1)
    view = (turn, eye, focal, image, left)
    composite(view, centers, spread, colours, np.asarray(splats.opacities, float))
    if ground is not None:
        flat = centers.copy()
        flat[:, 2] = ground
        dark = spread.copy() * 1.5
        dark[:, 2] = 0
        dark[:, 0, 0] += 0.02
        dark[:, 1, 1] += 0.02
        composite(view, flat, dark, np.full_like(colours, 0.82), np.full(len(flat), 0.06))
    return np.uint8(255 * np.clip(image + left[..., None], 0, 1))


def composite(view, centers, spread, colours, opacities):
    """Draws splats, the nearest first, into what is left."""
    turn, eye, focal, image, left = view
    height, width = left.shape
    seen = (centers - eye) @ turn.T
    depth = -seen[:, 2]
    scale = focal * height / 2
    middle = np.column_stack(
        [width / 2 + scale * seen[:, 0] / depth, height / 2 - scale * seen[:, 1] / depth]
    )
    slope = np.zeros((len(seen), 2, 3))
    slope[:, 0, 0], slope[:, 1, 1] = scale / depth, -scale / depth
    slope[:, 0, 2], slope[:, 1, 2] = scale * seen[:, 0] / depth**2, -scale * seen[:, 1] / depth**2
    half = slope @ turn @ spread
    flat = half @ half.swapaxes(1, 2) + 0.15 * np.eye(2)
    inverse = np.linalg.inv(flat)
    reach = SEEN * np.sqrt(np.einsum("nkk->nk", flat))
    low = np.maximum(np.floor(middle - reach).astype(int), 0)
    high = np.minimum(np.ceil(middle + reach).astype(int) + 1, (width, height))
    for i in np.argsort(depth, kind="stable"):
        (x, y), (right, below) = low[i], high[i]
        if right <= x or below <= y:
            continue
        there = left[y:below, x:right]
        if there.max() < 0.004:
            continue
        u = np.arange(x, right) + 0.5 - middle[i, 0]
        v = (np.arange(y, below) + 0.5 - middle[i, 1])[:, None]
        a, b, c = inverse[i, 0, 0], inverse[i, 0, 1], inverse[i, 1, 1]
        alpha = opacities[i] * np.exp(-0.5 * (a * u * u + 2 * b * u * v + c * v * v))
        image[y:below, x:right] += (there * alpha)[..., None] * colours[i]
        there *= 1 - alpha
