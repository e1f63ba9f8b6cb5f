# SPDX-License-Identifier: GPL-3.0-or-later
"""20,000 uniform samples of networks against iarap.sampling (the paper's authors' own), per point.

iarap takes a number of lines, not of points, and 2 ms a point: it gets LINES of them, and the same network in
PyTorch. `uniformity` is the total-variation distance (216 cells) of our samples to area-uniform ones of the
extracted mesh, over that between two area-uniform sets: 1 is ideal.
"""

import iarap.sampling
import numpy as np
import torch

import arapfields as af

from . import shapes, timing

NAMES = ["bunny", "whale", "cube"]
COUNT = 20_000
LINES = 2_000
THREADS = 2


class Counted:
    """The network in single precision, as published; counts evaluated points."""

    def __init__(self, layers):
        weights, biases, self.octaves, self.frequency, self.sharpness = layers
        self.layers = [
            (torch.tensor(weight, dtype=torch.float32), torch.tensor(bias, dtype=torch.float32))
            for weight, bias in zip(weights, biases, strict=True)
        ]
        self.evaluations = 0

    @torch.no_grad()
    def __call__(self, x):
        self.evaluations += len(x)
        angles = x.unsqueeze(-1) * (self.frequency * 2.0 ** torch.arange(self.octaves))
        h = torch.stack([torch.cos(angles), torch.sin(angles)], -1).flatten(-3)
        for weight, bias in self.layers[:-1]:
            h = torch.nn.functional.softplus(h @ weight.T + bias, beta=self.sharpness)
        return h @ self.layers[-1][0].T + self.layers[-1][1]


def cells(points):
    return np.histogramdd(points, bins=6, range=[(-1, 1)] * 3)[0].ravel() / len(points)


def uniformity(sdf, points):
    V, F = af.extract_surface(sdf, 128)
    areas = [cells(af.sample_mesh(V, F, COUNT, seed=seed).points) for seed in range(6)]
    between = np.mean([np.abs(a - b).sum() for a, b in zip(areas[::2], areas[1::2], strict=True)])
    return np.mean([np.abs(cells(points) - a).sum() for a in areas]) / between


def run(rounds=3):
    """A row per network: milliseconds and evaluations per point of both, and their ratio."""
    torch.set_num_threads(THREADS)
    rows = []
    for name in NAMES:
        sdf, network = shapes.sdf(name), Counted(shapes.layers(name))
        made, theirs_points = {}, []

        def ours(sdf=sdf, made=made):
            made["samples"] = af.sample_surface(sdf, COUNT, threads=THREADS)

        def theirs(network=network, points=theirs_points):
            points.append(len(iarap.sampling.uniform_sample(network, LINES, device="cpu")))

        torch.manual_seed(0)
        times = timing.paired(ours, theirs, rounds, warm_up=False)
        share = COUNT / np.mean(theirs_points)
        rows.append(
            {
                "case": shapes.label(name),
                "ours_ms_a_point": round(1e3 * times["ours_s"] / COUNT, 4),
                "iarap_ms_a_point": round(1e3 * times["theirs_s"] * share / COUNT, 3),
                "times_faster": round(times["times_faster"] * share, 1),
                "ours_evaluations_a_point": round(made["samples"].report.evaluations / COUNT, 2),
                "iarap_evaluations_a_point": round(network.evaluations / sum(theirs_points), 1),
                "uniformity": round(uniformity(sdf, af.sample_surface(sdf, COUNT).points), 3),
            }
        )
    return rows
