# SPDX-License-Identifier: GPL-3.0-or-later
"""The fitted surface moved forward, beside the zero set of Φ∘f⁻¹: two ways to the same surface."""

import numpy as np
import stage
from shapes import Shape

import arapfields as af

from .common import add, add_boxes, measured, shape, turned
from .deformations import CASES

CELLS = 40 if stage.DRAFT else 110
SPACING = 2.6


def surface(vertices, triangles, colour):
    return Shape(vertices, np.asarray(triangles), np.tile(colour, (len(vertices), 1)))


def pulled_back(sdf, inverse, around):
    """Vertices, triangles and the cell size of the zero set of Φ∘f⁻¹ on a grid about the deformed surface."""
    from skimage.measure import marching_cubes

    low, high = around.min(0), around.max(0)
    step = (high - low).max() / CELLS
    axes = [np.arange(a - 3 * step, b + 4 * step, step) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    values = sdf(inverse(grid.reshape(-1, 3))).reshape(grid.shape[:3])
    vertices, triangles, _, _ = marching_cubes(values, 0.0, spacing=(step,) * 3)
    return vertices + [axis[0] for axis in axes], triangles, step


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
    inverse = af.train_inverse(field, samples)
    vertices, triangles = af.extract_surface(sdf, 64 if stage.DRAFT else 192)
    rest = surface(vertices, triangles, stage.CLAY)
    forward = surface(field(vertices), triangles, stage.RESULT)
    *zero_set, step = pulled_back(sdf, inverse, forward.vertices)
    backward = surface(*zero_set, stage.SURFACE)
    distances = surface_distances(forward, backward) / step
    stage.clear()
    shown = []
    columns = ((rest, "fitted surface"), (forward, "moved by f"), (backward, "through the inverse"))
    for column, (made, text) in enumerate(columns):
        place = turned(rest, SPACING * column, degrees)
        shown += [add(made, text, place), *add_boxes(boxes, place, column > 0)]
        shown.append(stage.caption(text, (SPACING * column, -1.3, 0.0), 0.17))
    stage.photograph(shown, output / "inverse.png", size=(1200, 433), elevation=12)
    return {
        "deformed": measured(field),
        "fit_near_error": round(float(sdf.report["near_mean"]), 5),
        "inverse_error_mean": round(float(inverse.report["error_mean"]), 5),
        "cell": round(float(step), 4),
        "distance_in_cells_mean": round(float(distances.mean()), 3),
        "distance_in_cells_95_percent": round(float(np.quantile(distances, 0.95)), 3),
        "distance_in_cells_largest": round(float(distances.max()), 3),
    }
