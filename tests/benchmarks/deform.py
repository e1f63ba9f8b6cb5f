# SPDX-License-Identifier: GPL-3.0-or-later
"""Deformation: the bend of the bunny to a given quality, and single steps, against iarap's autograd."""

import itertools
import os
import statistics
import sys
import time
from pathlib import Path

import numpy as np

import arapfields as af

from .timing import once

sys.path.insert(0, str(Path(__file__).parents[1]))

ENERGY, HANDLE_ERROR, BENDING, HANDLE_WEIGHT = 0.0285, 0.005, 0.01, 100.0


def good(field):
    return field.report["energy"] <= ENERGY and field.report["handle_error_mean"] <= HANDLE_ERROR


def first_good(samples, handles, settings, counts):
    """The fewest of `counts` iterations that reach the quality, with the seconds of that run."""
    for count in counts:
        begin = time.perf_counter()
        field = af.deform(samples, handles, af.DeformOptions(iterations=count, **settings))
        seconds = time.perf_counter() - begin
        if good(field):
            return count, seconds, field.report
    return None, seconds, field.report


def their_network(width=256):
    """The same architecture in PyTorch, output layer at zero, as autograd needs it."""
    import torch

    class Network(torch.nn.Module):
        def __init__(self):
            super().__init__()
            sizes = [24, width, width, width, width]
            self.hidden = torch.nn.ModuleList(torch.nn.Linear(a, b) for a, b in itertools.pairwise(sizes))
            self.out = torch.nn.Linear(width, 3)
            torch.nn.init.zeros_(self.out.weight), torch.nn.init.zeros_(self.out.bias)

        def forward(self, x):
            angles = x.unsqueeze(-1) * 2.0 ** torch.arange(4)
            h = torch.stack([torch.cos(angles), torch.sin(angles)], -1).flatten(-3)
            for layer in self.hidden:
                h = torch.nn.functional.softplus(layer(h), beta=30)
            return x + self.out(h)

    torch.manual_seed(0)
    return Network()


def their_step(samples, handles, count):
    """One Adam step of the same loop over iarap's energy (its stretch is a third of the paper's)."""
    import iarap
    import torch

    network = their_network()
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    points = torch.tensor(samples.points, dtype=torch.float32)
    pairs = []
    for handle in handles:
        local = (samples.points - handle.rest[:3, 3]) @ np.linalg.inv(handle.rest[:3, :3]).T
        inside = points[torch.tensor(np.abs(local).max(1) <= 1)]
        motion = torch.tensor(handle.motion, dtype=torch.float32)
        pairs.append((inside, inside @ motion[:3, :3].T + motion[:3, 3]))

    def step():
        optimizer.zero_grad()
        batch = points[torch.randint(len(points), (count,))]
        loss = iarap.arap_energy(network, batch, BENDING / 3).mean() * 3
        for source, target in pairs:
            pick = torch.randint(len(source), (256,))
            loss = (
                loss
                + HANDLE_WEIGHT / len(pairs) * ((network(source[pick]) - target[pick]) ** 2).sum(1).mean()
            )
        loss.backward()
        optimizer.step()

    return step


def step_row(samples, handles, count, rounds=3, steps=5):
    """Seconds of a step (energy, gradient, handles, Adam) of the 4×256 network, ours and theirs in turn."""
    options = af.DeformOptions(iterations=steps, batch=count, optimizer="adam")
    theirs = their_step(samples, handles, count)
    theirs()
    pairs = []
    for _ in range(rounds):
        ours = af.deform(samples, handles, options).report["seconds"] / steps
        pairs.append((ours, once(theirs)))
    return {
        "what": f"a step of N = {count}, 4x256, against iarap's",
        "ours_s": round(statistics.median(a for a, _ in pairs), 4),
        "theirs_s": round(statistics.median(b for _, b in pairs), 4),
        "times_faster": round(statistics.median(b / a for a, b in pairs), 1),
    }


def run():
    import cases

    samples = cases.published_samples(Path(os.environ["ARAPFIELDS_DATA"]) / "neural_sdf" / "bunny.pt")
    handles = cases.bunny_handles()
    rows = []
    settings = {
        "radial": (dict(field="radial"), (8, 16, 32)),
        "neural 4x256": ({}, (40, 60, 80, 120)),
        "neural 4x128": (dict(width=128), (40, 60, 80, 120)),
        "neural 4x256, Adam": (dict(optimizer="adam"), (80, 120, 160, 240)),
    }
    for name, (options, counts) in settings.items():
        count, seconds, report = first_good(samples, handles, options, counts)
        rows.append(
            {
                "what": f"bunny to E <= {ENERGY}: {name}",
                "iterations": count,
                "seconds": round(seconds, 2),
                "energy": round(report["energy"], 4),
                "handle_error": round(report["handle_error_mean"], 4),
            }
        )
    return rows + [step_row(samples, handles, count) for count in (300, 1000, 4000)]
