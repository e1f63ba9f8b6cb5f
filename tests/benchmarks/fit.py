# SPDX-License-Identifier: GPL-3.0-or-later
"""Time of a fit of a cow to a mean near-surface error of 0.002, cube units, against plain PyTorch Adam."""

import time
from itertools import pairwise

import numpy as np
import torch

import arapfields as af

from . import shapes

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


def run():
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
