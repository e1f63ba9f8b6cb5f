# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces of networks at 256 points a side against dense evaluation and scikit-image.

PyTorch evaluates the dense grid in single precision, a plane of 65,536 points at a time. Both meshes are
compared vertex by vertex; they differ by what the two evaluations of the network round differently, most on
edges that the surface nearly touches (with the same values on both sides the tests find 1e-6).
"""

import numpy as np
import torch
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

import arapfields as af

from . import shapes, timing
from .sampling import THREADS, Counted

CASES = [("bunny", 256), ("whale", 256), ("cube", 256)]


def dense(network, resolution):
    t = torch.linspace(-1, 1, resolution)
    plane = torch.stack(torch.meshgrid(t, t, indexing="ij"), -1).reshape(-1, 2)
    values = np.empty((resolution,) * 3, np.float32)
    for i, x in enumerate(t):
        points = torch.cat([x.expand(len(plane), 1), plane], 1)
        parts = [network(part) for part in points.split(65536)]
        values[i] = torch.cat(parts).reshape(resolution, resolution).numpy()
    return marching_cubes(values, 0.0)[0] * (2 / (resolution - 1)) - 1


def run(rounds=1):
    """A row per network: seconds of both, their ratio, share of evaluations, largest vertex distance."""
    torch.set_num_threads(THREADS)
    rows = []
    for name, resolution in CASES:
        sdf, network = shapes.sdf(name), Counted(shapes.layers(name))
        found = {}

        def ours(sdf=sdf, n=resolution, found=found):
            found["ours"] = af.extract_surface(sdf, n, threads=THREADS)

        def theirs(network=network, n=resolution, found=found):
            found["theirs"] = dense(network, n)

        times = timing.paired(ours, theirs, rounds, warm_up=False)
        a, b = found["ours"].vertices, found["theirs"]
        distance = max(cKDTree(a).query(b)[0].max(), cKDTree(b).query(a)[0].max())
        report = found["ours"].report
        share = report.evaluations / report.dense_evaluations
        rows.append(
            {"case": f"{shapes.label(name)} {resolution}", **times, "evaluated": f"{share:.2%}"}
            | {"vertices": len(a), "same_number": len(a) == len(b), "largest_distance": f"{distance:.1e}"}
        )
    return rows
