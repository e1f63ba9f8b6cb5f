# SPDX-License-Identifier: GPL-3.0-or-later
"""Random walks, and the shortest part of each that fails: `python -m tests.fuzz.walk [--steps N] …`.

The exit code is 1 where one fails. `--again TEXT` takes a walk that was printed.
"""

import argparse
import secrets
import sys
import time

from .run import Blender, Walk, draw, report, shorten


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.walk", description=__doc__)
    parser.add_argument("--steps", type=int, default=10000, help="of each seed [10000]")
    parser.add_argument("--seeds", type=int, nargs="+", help="[a new one]")
    parser.add_argument("--again", type=Walk.of, help="a walk, as JSON")
    parser.add_argument(
        "--python", default=sys.executable, help="a Python with bpy and arapfields [this one]"
    )
    parser.add_argument("--as-they-are", action="store_true", help="failing walks are not shortened")
    options = parser.parse_args()
    blender, failed = Blender(options.python), 0
    plans = {seed: draw(seed, options.steps) for seed in options.seeds or [secrets.randbelow(1 << 30)]}
    if options.again:
        plans = {"again": [options.again]}
    for seed, walks in plans.items():
        begin, taken, broken = time.perf_counter(), 0, 0
        for walk in walks:
            outcome = blender.take(walk)
            taken += outcome.taken
            if outcome.broken:
                broken += 1
                outcome = outcome if options.as_they_are else shorten(blender, outcome)
                print(f"{report(outcome)}\n--again '{outcome.walk.text()}'\n", flush=True)
        steps = sum(len(walk.steps) for walk in walks)
        seconds = time.perf_counter() - begin
        print(
            f"seed {seed}: {steps} steps drawn, {taken} taken, {broken} broken, {seconds:.0f} s", flush=True
        )
        failed += broken
    blender.stop()
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
