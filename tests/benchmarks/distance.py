# SPDX-License-Identifier: GPL-3.0-or-later
"""Signed distances of 300,000 points against libigl, build of the hierarchy included on both sides.

Meshes: a torus in 16k and 265k triangles (closed) and Suzanne subdivided to 16k (open, running through
itself). Points: uniform in the bounding cube, and area-uniform with Gaussian offsets of 1 % of the diagonal.
"""

import sys
from pathlib import Path

import igl
import numpy as np

import arapfields as af

from . import timing

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from support.geometry import meshes

POINTS = 300_000
THREADS = 2


def suzanne(levels):
    vertices, triangles = meshes.suzanne()
    for _ in range(levels):
        vertices, triangles = meshes.subdivide(vertices, triangles)
    return vertices, triangles


def cases():
    yield "torus", meshes.torus(around=128, tube=64)
    yield "torus", meshes.torus(around=512, tube=259)
    yield "suzanne", suzanne(2)
    yield "suzanne", suzanne(4)


def points_of(vertices, triangles):
    rng = np.random.default_rng(0)
    low, high = vertices.min(0), vertices.max(0)
    center, half = (low + high) / 2, (high - low).max() / 2
    near = af.sample_mesh(vertices, triangles, POINTS, seed=1).points
    return {
        "uniform": center + half * rng.uniform(-1, 1, (POINTS, 3)),
        "near": near + rng.normal(0, 0.01 * np.linalg.norm(high - low), near.shape),
    }


def run(rounds=3):
    """A row per mesh and kind of points: thousand points per second of both, and their ratio."""
    rows = []
    for name, (vertices, triangles) in cases():
        triangles = triangles.astype(np.int64)
        for kind, points in points_of(vertices, triangles).items():
            found = {}

            def ours(v=vertices, f=triangles, p=points, found=found):
                found["ours"] = af.signed_distance(v, f, p, threads=THREADS)

            def theirs(v=vertices, f=triangles, p=points, found=found):
                sign = igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
                found["theirs"] = igl.signed_distance(p, v, f, sign_type=sign)[0]

            seconds = timing.paired(ours, theirs, rounds=rounds, warm_up=False)
            same_side = np.mean((found["ours"] < 0) == (found["theirs"] < 0))
            rows.append(
                {
                    "name": f"signed distance, {name}, {len(triangles)} triangles, {kind}",
                    "ours": round(POINTS / seconds["ours_s"] / 1e3),
                    "competitor": round(POINTS / seconds["theirs_s"] / 1e3),
                    "unit": "thousand points/s",
                    "ratio": seconds["times_faster"],
                    "same_side": round(float(same_side), 5),
                    **seconds,
                }
            )
            print(rows[-1], flush=True)
    return rows
