# SPDX-License-Identifier: GPL-3.0-or-later
"""Styles read off objects: a column an object, shown on top, a row a shape, all options by default."""

import bpy
import numpy as np
import stage
from shapes import Ellipsoid, Shape, build

import arapfields as af

from .common import add, in_column, samples_of, shape, stack, suzanne, warped

ROWS = [("dog", 48), ("suzanne", 28), ("octopus", 0)]  # and its turn
SPACING, SAMPLES = 2.1, 6000
COLOUR = (0.42, 0.20, 0.08)


def sphere(subdivisions):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=subdivisions)
    return taken(bpy.context.object)


def taken(item):
    """A mesh object as a Shape; it is removed."""
    mesh = item.data
    mesh.calc_loop_triangles()
    vertices = np.array([vertex.co for vertex in mesh.vertices], float)
    triangles = np.array([triangle.vertices for triangle in mesh.loop_triangles], np.int64)
    bpy.data.objects.remove(item, do_unlink=True)
    return Shape(vertices, triangles, np.tile(COLOUR, (len(vertices), 1)))


def superquadric(power, scale=(1.0, 1.0, 1.0)):
    ball = sphere(6)
    norm = (np.abs(ball.vertices) ** power).sum(1, keepdims=True) ** (1 / power)
    return ball._replace(vertices=ball.vertices / norm * scale)


def rock():
    ball, rng = sphere(2), np.random.default_rng(5)
    return ball._replace(
        vertices=ball.vertices * rng.uniform(0.8, 1.15, (len(ball.vertices), 1)) * (1, 0.8, 0.75)
    )


def head():
    """A head of few triangles."""
    made = build(
        [
            Ellipsoid((0, 0, 0.25), (0.62, 0.75, 0.7)),
            Ellipsoid((0, -0.25, -0.35), (0.42, 0.45, 0.45)),
            Ellipsoid((0, -0.78, 0.0), (0.13, 0.2, 0.2)),
            Ellipsoid((0.6, 0.05, 0.05), (0.1, 0.16, 0.25)),
            Ellipsoid((-0.6, 0.05, 0.05), (0.1, 0.16, 0.25)),
            Ellipsoid((0, 0.1, -0.8), (0.32, 0.36, 0.5)),
        ],
        0.1,
        base=COLOUR,
        cells=60,
    )
    item = add(made, "head")
    modifier = item.modifiers.new("Decimate", "DECIMATE")
    modifier.ratio = 160 / len(made.triangles)
    bpy.context.view_layer.objects.active = item
    bpy.ops.object.modifier_apply(modifier="Decimate")
    return taken(item)


OBJECTS = {
    "cube": lambda: taken_primitive("cube"),
    "rounded cube": lambda: superquadric(4),
    "spindle": lambda: superquadric(1.3, (0.7, 0.7, 1.2)),
    "rock": rock,
    "head": head,
    "cylinder": lambda: taken_primitive("cylinder"),
}
ENDS = [(-0.5 * SPACING, 0.0, 0.5), ((len(OBJECTS) + 0.5) * SPACING, 0.0, 0.5)]


def taken_primitive(name):
    getattr(bpy.ops.mesh, f"primitive_{name}_add")()
    return taken(bpy.context.object)


def flat(item):
    item.data.polygons.foreach_set("use_smooth", [False] * len(item.data.polygons))
    return item


def render(output):
    paths, results = [output / "style-objects-0.png"], {}
    stage.clear()
    objects = {name: make() for name, make in OBJECTS.items()}
    stage.clear()
    shown = []
    for column, (name, made) in enumerate(objects.items(), 1):
        item = add(made, name, in_column(made, made, column, 25, SPACING))
        shown.append(item if name in ("rounded cube", "spindle") else flat(item))
        shown.append(stage.caption(name, (SPACING * column, -1.0, -0.5), 0.24))
    stage.photograph(shown, paths[0], elevation=12, around=ENDS, margin=0.01)
    for name, degrees in ROWS:
        rest = suzanne() if name == "suzanne" else shape(name)
        samples = samples_of(rest, SAMPLES)
        stage.clear()
        shown = [add(rest, name, in_column(rest, rest, 0, degrees, SPACING))]
        for column, (style, made) in enumerate(objects.items(), 1):
            object_style = af.ObjectStyle(made.vertices, made.triangles)
            field = af.stylize(samples, object_style)
            moved = warped(rest, field)
            shown.append(add(moved, style, in_column(moved, rest, column, degrees, SPACING)))
            agreement = (samples.normals * object_style.normals(samples.normals)).sum(1).mean()
            results[f"{name}, {style}"] = {
                "agreement_rest": round(float(agreement), 4),
                "agreement": round(field.report.preference, 4),
                "flipped_share": round(field.report.flipped_share, 4),
                "min_determinant": round(field.report.min_determinant, 4),
            }
        paths.append(output / f"style-objects-{name}.png")
        stage.photograph(shown, paths[-1], elevation=12, around=ENDS, margin=0.01)
    stack(paths, output / "style-objects.png")
    return results
