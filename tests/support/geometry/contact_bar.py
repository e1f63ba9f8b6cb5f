# SPDX-License-Identifier: GPL-3.0-or-later
"""A bar pressed onto solids."""

import numpy as np
import trimesh

import arapfields as af

from .bar import LEFT, RIGHT, turned
from .nudge import nudged

# Contact goes without locality, and so do the solves that it is compared with.
QUICK = af.LiveOptions(samples=800, coarse_centers=30, fine_centers=150, locality=0)
DEEPEST = 0.004  # 0.1 % of the bar's length
ALIKE = 0.04  # 1 % of it: difference of solves that end a little earlier
DOWN = turned(0, shift=(0, 0, -0.9))
DEEP = [LEFT, DOWN @ RIGHT]


def solid(mesh, center):
    return af.MeshSdf(nudged(mesh.vertices + np.array(center)), mesh.faces)


BALL = solid(trimesh.creation.icosphere(3, 0.5), [1.2, 0, -1.2])
BLOCK = solid(trimesh.creation.box((0.6, 3, 0.6)), [1.0, 0, -1.1])
PLATE = solid(trimesh.creation.box((3, 3, 0.03)), [1.5, 0, -0.8])
SHEET = af.MeshSdf(
    np.array([[0, -2, -0.8], [4, -2, -0.8], [4, 2, -0.8], [0, 2, -0.8]]), np.array([[0, 1, 2], [0, 2, 3]])
)


class Plane(af.ImplicitFunction):
    gradient_bound = 1.0

    def __call__(self, points):
        return points[:, 2] + 0.8


def live(samples, contact=None):
    return af.LiveDeformer(samples, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)], QUICK, contact=contact)
