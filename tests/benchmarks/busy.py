# SPDX-License-Identifier: GPL-3.0-or-later
"""How much longer calls take while as many other processes are busy as there are processors (fair: 2)."""

import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

TESTS = str(Path(__file__).parents[1])
CODE = f"""
import sys; sys.path[:0] = [{TESTS!r}, {TESTS + "/.."!r}]
from tests.benchmarks import busy
busy.measure(*sys.argv[1:])
"""


def work(name):
    """The call that is timed: 60 iterations of a deformation, or fifteen live solves."""
    from support.geometry.cases import bar_handles, bar_samples

    import arapfields as af

    if name == "deform":
        options = af.DeformOptions(iterations=60, width=128, batch=1000)
        return lambda: af.deform(bar_samples(), bar_handles(), options)
    live = af.LiveDeformer(bar_samples(4000), bar_handles(), af.LiveOptions())

    def solve():
        for degrees in range(4, 64, 4):
            live.solve([handle.target for handle in bar_handles(degrees)])
        live.reset()

    return solve


def measure(name, first, rounds):
    """In a separate process: prints the seconds alone and beside busy processes, measured alternately."""
    if first == "torch":
        import torch  # noqa: F401  (it decides how OpenMP is set up)

    from tests.benchmarks.timing import once

    call = work(name)
    call()
    pairs = []
    for _ in range(int(rounds)):
        alone = once(call)
        others = [
            subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)
        ]
        try:
            pairs.append((alone, once(call)))
        finally:
            for other in others:
                other.kill()
                other.wait()
    print(json.dumps(pairs))


def slowdown(name, first, rounds=5):
    """(seconds alone, seconds beside the others, median of the ratios); `first`: module imported before."""
    run = subprocess.run(
        [sys.executable, "-c", CODE, name, first, str(rounds)], capture_output=True, text=True, check=True
    )
    pairs = json.loads(run.stdout)
    alone, beside = (statistics.median(column) for column in zip(*pairs, strict=True))
    return alone, beside, statistics.median(b / a for a, b in pairs)


def run():
    rows = []
    for name in ("deform", "live"):
        for first in ("torch", "arapfields"):
            alone, beside, ratio = slowdown(name, first)
            rows.append(
                {
                    "what": f"{name}, {first} imported first",
                    "alone_s": round(alone, 3),
                    "beside_busy_s": round(beside, 3),
                    "times_as_long": round(ratio, 2),
                }
            )
    return rows
