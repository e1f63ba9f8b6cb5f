# SPDX-License-Identifier: GPL-3.0-or-later
"""A fork: a tube along a U, whose legs are close in space but far apart along the surface."""

import numpy as np
from support.geometry.bar import box
from support.geometry.nudge import nudged

import arapfields as af

RADIUS, BEND, LEG = 0.15, 0.22, 1.0
LEGS = {side: np.array([[side * BEND, 0, LEG + RADIUS]]) for side in (-1, 1)}
BOTTOM = box([0, 0, -BEND], [0.6, 0.3, 0.3])
TIP = box([BEND, 0, LEG], [0.2, 0.2, 0.2])


def fork_samples(count=8000, seed=0):
    """Samples with normals of legs of length LEG along z at x = ±BEND, a half circle below and round ends."""
    rng = np.random.default_rng(seed)
    arc, cap = np.pi * BEND, 2 * np.pi * RADIUS**2
    tube = 2 * np.pi * RADIUS * (2 * LEG + arc)
    on_cap = rng.random(count) < 2 * cap / (2 * cap + tube)
    along = rng.uniform(0, 2 * LEG + arc, count)
    angle = (np.clip(along, LEG, LEG + arc) - LEG) / BEND
    outward = np.c_[-np.cos(angle), np.zeros(count), -np.sin(angle)]  # from the middle of the bend
    center = BEND * outward
    center[:, 2] += np.where(along < LEG, LEG - along, np.maximum(along - LEG - arc, 0.0))
    turn = rng.uniform(0, 2 * np.pi, count)
    normals = np.cos(turn)[:, None] * outward + np.sin(turn)[:, None] * [0.0, 1.0, 0.0]
    round_ = rng.normal(size=(count, 3))
    round_[:, 2] = np.abs(round_[:, 2])
    round_ /= np.linalg.norm(round_, axis=1)[:, None]
    ends = np.c_[rng.choice([-BEND, BEND], count), np.zeros(count), np.full(count, LEG)]
    center[on_cap], normals[on_cap] = ends[on_cap], round_[on_cap]
    return af.SurfaceSamples(nudged(center + RADIUS * normals), normals)
