# SPDX-License-Identifier: GPL-3.0-or-later
"""The fitted surface moved forward, beside the zero set of Φ∘f⁻¹ by two inverses."""

import time

import numpy as np
import stage
from shapes import Shape

import arapfields as af

from .common import add, add_boxes, measured, shape, turned
from .deformations import CASES

FORWARD, INVERSE = (64, 40) if stage.DRAFT else (192, 128)  # grid points a side
SPACING = 2.3


def surface(vertices, triangles, colour):
    return Shape(vertices, np.asarray(triangles), np.tile(colour, (len(vertices), 1)))


def surface_distances(a, b):
    """Distances from each vertex of one mesh to the other surface, both ways."""
    there = np.abs(af.signed_distance(b.vertices, b.triangles, a.vertices))
    back = np.abs(af.signed_distance(a.vertices, a.triangles, b.vertices))
    return np.concatenate([there, back])


def evenness(made):
    """Spread of the triangles' areas: standard deviation over mean."""
    a, b, c = (made.vertices[made.triangles[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return round(float(areas.std() / areas.mean()), 2)


def pulled_back(sdf, field, inverse, colour, forward):
    """The zero set of Φ∘f⁻¹, and how far it is from the surface moved forward, in cells of its grid."""
    begin = time.perf_counter()
    extracted = af.extract_deformed(sdf, field, INVERSE, inverse=inverse)
    seconds, report = time.perf_counter() - begin, extracted.report
    made = surface(*extracted, colour)
    cells = surface_distances(forward, made) / report.spacing
    return made, {
        "seconds": round(seconds, 1),
        "cell": round(float(report.spacing), 4),
        "points_inverted": report.inverted,
        "failures": report.failures,
        "cells_apart_mean": round(float(cells.mean()), 3),
        "cells_apart_95_percent": round(float(np.quantile(cells, 0.95)), 3),
        "cells_apart_largest": round(float(cells.max()), 3),
        "evenness": evenness(made),
    }


def render(output):
    degrees, boxes = CASES["dog"]
    mesh = shape("dog")
    sdf = af.fit_sdf(mesh.vertices, mesh.triangles)
    samples = af.sample_surface(sdf, 20000)
    field = af.deform(
        samples, [box.handle for box in boxes], af.DeformOptions(iterations=60 if stage.DRAFT else 300)
    )
    inverse = af.train_inverse(
        field, samples, af.InverseTrainingOptions(iterations=100 if stage.DRAFT else 600)
    )
    vertices, triangles = af.extract_surface(sdf, FORWARD)
    rest = surface(vertices, triangles, stage.CLAY)
    forward = surface(field(vertices), triangles, stage.RESULT)
    newton, by_newton = pulled_back(sdf, field, None, stage.SURFACE, forward)
    trained, by_training = pulled_back(sdf, field, inverse, (0.36, 0.58, 0.40), forward)
    stage.clear()
    shown = []
    columns = ((rest, "fitted"), (forward, "moved by f"), (newton, "Newton's f⁻¹"), (trained, "trained f⁻¹"))
    for column, (made, text) in enumerate(columns):
        place = turned(rest, SPACING * column, degrees)
        shown += [add(made, text, place), *add_boxes(boxes, place, column > 0)]
        shown.append(stage.caption(text, (SPACING * column, -1.3, 0.0), 0.2))
    stage.photograph(shown, output / "inverse.png", elevation=12)
    return {
        "deformed": measured(field),
        "fit_near_error": round(float(sdf.report.near_mean), 5),
        "trained_error_mean": round(float(inverse.report.error_mean), 5),
        "forward_evenness": evenness(forward),
        "newton": by_newton,
        "trained": by_training,
    }
