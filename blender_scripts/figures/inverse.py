# SPDX-License-Identifier: GPL-3.0-or-later
"""The fitted surface moved forward, beside the zero set of Φ∘f⁻¹: two ways to the same surface."""

import numpy as np
import stage
from shapes import Shape

import arapfields as af

from .common import add, add_boxes, measured, shape, turned
from .deformations import CASES

RESOLUTION = 160
SPACING = 2.6


def surface(vertices, triangles, colour):
    return Shape(vertices, np.asarray(triangles), np.tile(colour, (len(vertices), 1)))


def surface_distances(a, b):
    """Distances from each vertex of one mesh to the other surface, both ways."""
    there = np.abs(af.signed_distance(b.vertices, b.triangles, a.vertices))
    back = np.abs(af.signed_distance(a.vertices, a.triangles, b.vertices))
    return np.concatenate([there, back])


def render(output):
    degrees, boxes = CASES["dog"]
    mesh = shape("dog")
    sdf = af.fit_sdf(mesh.vertices, mesh.triangles)
    samples = af.sample_surface(sdf, 20000)
    field = af.deform(
        samples, [box.handle for box in boxes], af.DeformOptions(iterations=60 if stage.DRAFT else 300)
    )
    resolution = 64 if stage.DRAFT else RESOLUTION
    vertices, triangles = af.extract_surface(sdf, resolution)
    rest = surface(vertices, triangles, stage.CLAY)
    forward = surface(field(vertices), triangles, stage.RESULT)
    pulled = surface(*af.extract_deformed(sdf, field, resolution), stage.SURFACE)
    distances = surface_distances(forward, pulled) / (2 * sdf.report["scale"] / resolution)
    stage.clear()
    shown = []
    columns = ((rest, "fitted surface Φ = 0"), (forward, "moved by f"), (pulled, "Φ∘f⁻¹ = 0"))
    for column, (made, text) in enumerate(columns):
        place = turned(rest, SPACING * column, degrees)
        shown += [add(made, text, place), *add_boxes(boxes, place, column > 0)]
        shown.append(stage.caption(text, (SPACING * column, -1.3, 0.0), 0.17))
    stage.photograph(shown, output / "inverse.png", size=(1200, 433), elevation=12)
    return {
        "deformed": measured(field),
        "fit_near_error": round(float(sdf.report["near_mean"]), 5),
        "distance_in_voxels_mean": round(float(distances.mean()), 3),
        "distance_in_voxels_largest": round(float(distances.max()), 3),
    }
