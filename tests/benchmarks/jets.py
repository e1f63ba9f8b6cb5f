# SPDX-License-Identifier: GPL-3.0-or-later
"""The network's jets and their pull-back against the bare matrix products of the same sizes; peak memory."""

import subprocess
import sys

import torch

from arapfields._native import testing

from .timing import paired

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


def run():
    rows = []
    for points in (300, 1000, 4000):
        for order, columns in ((2, 10), (1, 4), (0, 1)):
            trial = testing.JetTrial(points, order)
            times = paired(trial.run, bare_products(points, columns), rounds=7 if points < 4000 else 5)
            share = round(times["ours_s"] / times["theirs_s"], 2)
            rows.append({"points": points, "columns": columns, **times, "of_products": share})
    rows.append({"points": 4000, "columns": 10, "peak_MiB": round(peak_memory(4000))})
    return rows
