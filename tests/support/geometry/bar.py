# SPDX-License-Identifier: GPL-3.0-or-later
"""A bar of size 4 × 1 × 1 along x with a handle at each end."""

import numpy as np
from support.geometry.nudge import nudged

import arapfields as af


def bar_samples(count=6000, seed=0):
    """Uniform samples of the bar's surface, with normals."""
    rng = np.random.default_rng(seed)
    half = np.array([2.0, 0.5, 0.5])
    areas = np.array([half[1] * half[2], half[0] * half[2], half[0] * half[1]])
    axis = rng.choice(3, size=count, p=areas / areas.sum())
    side = rng.choice([-1.0, 1.0], size=count)
    points = rng.uniform(-1, 1, size=(count, 3)) * half
    normals = np.zeros((count, 3))
    normals[np.arange(count), axis] = side
    points[np.arange(count), axis] = side * half[axis]
    return af.SurfaceSamples(nudged(points), normals)


def box(center, half):
    matrix = np.diag([*map(float, half), 1.0])
    matrix[:3, 3] = center
    return matrix


def turned(degrees, axis=1, shift=(0, 0, 0)):
    angle = np.radians(degrees)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
    matrix[:3, 3] = shift
    return matrix


LEFT, RIGHT = box([-1.8, 0, 0], [0.3, 0.6, 0.6]), box([1.8, 0, 0], [0.3, 0.6, 0.6])
