# SPDX-License-Identifier: GPL-3.0-or-later
"""The stages before a solve: fits, jets, samples, signed distances, extraction."""

import subprocess
import sys
import time
from itertools import pairwise

import numpy as np
import torch
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

import arapfields as af
from arapfields._native import testing

from . import shapes
from .shapes import meshes, paired

# Time of a fit of a cow to a mean near-surface error of 0.002, cube units, against plain PyTorch Adam.

TARGET, BATCH, SEED = 0.002, 1024, 0
STEPS_TO_TARGET = 135  # iterations of fit_sdf, with its schedule; the row contains the error


def points_near(mesh, count, seed):
    spread = np.where(np.arange(count) % 2, 0.05, 0.01)[:, None]
    moved = np.random.default_rng(seed).normal(size=(count, 3)) * spread
    return np.clip(af.sample_mesh(*mesh, count=count, seed=seed).points + moved, -1, 1)


def plain_adam(mesh, held_out, expected, limit=6000):
    """Seconds (including distances) and steps to the target, and the error then; constant rate 1e-3."""
    torch.manual_seed(SEED)
    begin = time.perf_counter()
    points = np.concatenate(
        [points_near(mesh, 150000, 1), np.random.default_rng(2).uniform(-1, 1, (40000, 3))]
    )
    distances = torch.tensor(af.signed_distance(*mesh, points), dtype=torch.float32)
    points = torch.tensor(points, dtype=torch.float32)
    sizes = [24, 256, 256, 256, 256, 1]
    linear = [torch.nn.Linear(a, b) for a, b in pairwise(sizes)]
    optimizer = torch.optim.Adam([p for layer in linear for p in layer.parameters()], 1e-3)

    def network(x):
        angles = x.unsqueeze(-1) * 2.0 ** torch.arange(4)
        h = torch.stack([torch.cos(angles), torch.sin(angles)], -1).flatten(-3)
        for layer in linear[:-1]:
            h = torch.nn.functional.softplus(layer(h), beta=30)
        return linear[-1](h)[:, 0]

    seconds, near = time.perf_counter() - begin, int(0.8 * BATCH)
    for step in range(1, limit + 1):
        begin = time.perf_counter()
        rows = torch.cat([torch.randint(150000, (near,)), torch.randint(150000, 190000, (BATCH - near,))])
        loss = (network(points[rows]) - distances[rows]).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        seconds += time.perf_counter() - begin
        if step % 25 == 0:  # not counted
            with torch.no_grad():
                error = (network(held_out) - expected).abs().mean().item()
            if error <= TARGET:
                break
    return seconds, step, error


def run_fit():
    mesh = shapes.mesh("spot")
    held_out = points_near(mesh, 10000, 99)
    expected = af.signed_distance(*mesh, held_out)
    begin = time.perf_counter()
    sdf = af.fit_sdf(*mesh, af.FitOptions(iterations=STEPS_TO_TARGET, batch=BATCH, seed=SEED))
    ours = time.perf_counter() - begin
    error = np.abs(sdf(held_out) - expected).mean()
    as_floats = (torch.tensor(x, dtype=torch.float32) for x in (held_out, expected))
    theirs, steps, their_error = plain_adam(mesh, *as_floats)
    return [
        {
            "shape": shapes.label("spot"),
            "target": TARGET,
            "ours_s": round(ours, 2),
            "ours_error": round(float(error), 5),
            "ours_steps": STEPS_TO_TARGET,
            "theirs_s": round(theirs, 2),
            "theirs_error": round(their_error, 5),
            "theirs_steps": steps,
            "times_faster": round(theirs / ours, 2),
        }
    ]


# The network's jets and their pull-back against the bare matrix products of the same sizes; peak memory.

WIDTH, LAYERS, ENCODED, OUTPUTS = 256, 4, 24, 3


def bare_products(points, columns):
    """The necessary matrix products with all columns, by torch.mm."""
    rows = points * columns
    sizes = [(ENCODED, WIDTH), *[(WIDTH, WIDTH)] * (LAYERS - 1), (WIDTH, OUTPUTS)]
    below = {size: torch.randn(rows, size) for size in (ENCODED, WIDTH)}
    above = {size: torch.randn(rows, size) for size in (WIDTH, OUTPUTS)}
    weights = [torch.randn(b, a) for a, b in sizes]

    def run():
        for (a, b), weight in zip(sizes, weights, strict=True):
            torch.mm(below[a], weight.T, out=above[b])
        for (a, b), weight in zip(sizes, weights, strict=True):
            torch.mm(above[b].T, below[a])
            if a == WIDTH:
                torch.mm(above[b], weight, out=below[a])

    return run


def peak_memory(points):
    """Additional memory of one evaluation, in MiB."""
    code = (
        "from pathlib import Path\nfrom arapfields._native import testing\n"
        "def peak(): return int(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0]) / 1024\n"
        "testing.JetTrial(8, 2).run(); before = peak()\n"
        f"testing.JetTrial({points}, 2).run(); print(peak() - before)"
    )
    return float(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)


def run_jets():
    rows = []
    for points in (300, 1000, 4000):
        for order, columns in ((2, 10), (1, 4), (0, 1)):
            trial = testing.JetTrial(points, order)
            times = paired(trial.run, bare_products(points, columns), rounds=7 if points < 4000 else 5)
            share = round(times["ours_s"] / times["theirs_s"], 2)
            rows.append({"points": points, "columns": columns, **times, "of_products": share})
    rows.append({"points": 4000, "columns": 10, "peak_MiB": round(peak_memory(4000))})
    return rows


# 20,000 uniform samples of networks against iarap.sampling (the paper's authors' own), per point.
#
# iarap takes a number of lines, not of points, and 2 ms a point: it gets LINES of them, and the same
# network in PyTorch. `uniformity` is the total-variation distance (216 cells) of our samples to area-
# uniform ones of the extracted mesh, over that between two area-uniform sets: 1 is ideal.

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


def run_sampling(rounds=3):
    """A row per network: milliseconds and evaluations per point of both, and their ratio."""
    import iarap.sampling

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
        times = shapes.paired(ours, theirs, rounds, warm_up=False)
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


# Signed distances of 300,000 points against libigl, build of the hierarchy included on both sides.
#
# Meshes: a torus in 16k and 265k triangles (closed) and Suzanne subdivided to 16k (open, running through
# itself). Points: uniform in the bounding cube, and area-uniform with Gaussian offsets of 1 % of the
# diagonal.

POINTS = 300_000


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


def run_distance(rounds=3):
    """A row per mesh and kind of points: thousand points per second of both, and their ratio."""
    import igl

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

            seconds = shapes.paired(ours, theirs, rounds=rounds, warm_up=False)
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


# Surfaces of networks at 256 points a side against dense evaluation and scikit-image.
#
# PyTorch evaluates the dense grid in single precision, a plane of 65,536 points at a time. Both meshes are
# compared vertex by vertex; they differ by what the two evaluations of the network round differently, most
# on edges that the surface nearly touches (with the same values on both sides the tests find 1e-6).

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


def run_extraction(rounds=1):
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

        times = shapes.paired(ours, theirs, rounds, warm_up=False)
        a, b = found["ours"].vertices, found["theirs"]
        distance = max(cKDTree(a).query(b)[0].max(), cKDTree(b).query(a)[0].max())
        report = found["ours"].report
        share = report.evaluations / report.dense_evaluations
        rows.append(
            {"case": f"{shapes.label(name)} {resolution}", **times, "evaluated": f"{share:.2%}"}
            | {"vertices": len(a), "same_number": len(a) == len(b), "largest_distance": f"{distance:.1e}"}
        )
    return rows
