# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats on an ellipsoid."""

import numpy as np

import arapfields as af

from .meshes import sphere

SIZE = np.array([0.8, 0.25, 0.2])
MESH = (sphere(1.0, 4)[0] * SIZE, sphere(1.0, 4)[1])


def splats(count=250, harmonics=16, width=0.05, seed=0):
    """Flat splats of various colors on an ellipsoid."""
    rng = np.random.default_rng(seed)
    samples = af.sample_mesh(*MESH, count=count, seed=seed)
    x, y, z = samples.normals.T  # rotations from z to the normals
    turns = np.column_stack([1 + z + 1e-9, -y, x, 0 * x])
    scales = width * np.array([1.0, 0.7, 0.1]) * rng.uniform(0.9, 1.1, (count, 3))
    colours = 0.25 * rng.normal(size=(count, harmonics, 3))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return af.GaussianSplats(samples.points, turns, scales, rng.uniform(0.3, 0.95, count), colours)
