# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulated scan of another dog: grey, rough, open below."""

import functools

import numpy as np
from shapes import Cone, Ellipsoid, Shape, build, mirrored, tube

CLAY = (0.45, 0.46, 0.48)
ROUGHNESS = 0.0025


@functools.cache
def hound():
    """The scan of a taller dog with a long muzzle, a deep chest and a hanging tail."""
    body = tube([(0, -0.50, 0.90), (0, -0.05, 0.93), (0, 0.50, 0.95)], [0.31, 0.23, 0.21])
    head = [
        *tube([(0, -0.52, 0.98), (0, -0.70, 1.30)], [0.19, 0.14]),
        Ellipsoid((0, -0.76, 1.40), (0.20, 0.22, 0.19)),
        Cone((0, -0.92, 1.34), (0, -1.27, 1.28), 0.115, 0.07, blend=0.06),
        Ellipsoid((0, -1.31, 1.31), (0.045, 0.04, 0.04), blend=0.02),
    ]
    tail = tube(
        [(0, 0.66, 1.02), (0, 0.86, 0.98), (0, 1.06, 1.04), (0, 1.20, 1.22)],
        [0.09, 0.07, 0.06, 0.035],
        blend=0.06,
    )
    side = [
        Cone((0.15, -0.68, 1.53), (0.24, -0.66, 1.74), 0.10, 0.025, blend=0.06),
        *tube(
            [(0.17, -0.50, 0.75), (0.19, -0.50, 0.38), (0.19, -0.55, 0.08)], [0.14, 0.085, 0.075], blend=0.08
        ),
        Ellipsoid((0.19, -0.61, 0.06), (0.085, 0.13, 0.062), blend=0.04),
        *tube([(0.16, 0.50, 0.82), (0.20, 0.44, 0.45), (0.19, 0.58, 0.08)], [0.19, 0.10, 0.075], blend=0.08),
        Ellipsoid((0.19, 0.52, 0.06), (0.085, 0.13, 0.062), blend=0.04),
    ]
    whole = build([*body, *head, *tail, *mirrored(side)], 0.12, base=CLAY, cells=110)
    return as_scanned(whole)


def as_scanned(shape, seed=0):
    """The shape with noise, without the faces towards the floor."""
    a, b, c = (shape.vertices[shape.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    seen = normals[:, 2] > -0.75
    kept, triangles = np.unique(shape.triangles[seen], return_inverse=True)
    noise = np.random.default_rng(seed).normal(0, ROUGHNESS, (len(kept), 3))
    return Shape(shape.vertices[kept] + noise, triangles.reshape(-1, 3), shape.colours[kept])
