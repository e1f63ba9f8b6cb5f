# SPDX-License-Identifier: GPL-3.0-or-later
"""The long walk: `python -m tests.blender.walk [--steps 10000] [--seeds 3]`; exit code 1 where it breaks."""

import argparse
import collections
import sys
import time
import traceback
from pathlib import Path

import bpy  # noqa: F401

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


def main():
    import addon

    from . import world
    from .rule import Broken, Walk

    parser = argparse.ArgumentParser(prog="python -m tests.blender.walk", description=__doc__)
    parser.add_argument("--steps", type=int, default=10000, help="of each seed [10000]")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--tolerance", type=float, default=1e-5, help="share of the size [1e-5]")
    options = parser.parse_args()
    addon.register()
    world.few_centers()
    broken = 0
    for seed in options.seeds:
        begin, taken, walks, kinds = time.perf_counter(), 0, 0, collections.Counter()
        walk = Walk([seed, walks], options.tolerance)
        while taken < options.steps:
            try:
                taken += walk.step()
            except Exception as error:  # the rule is broken, or a step fails: on with another scene
                if not isinstance(error, Broken):
                    traceback.print_exc()
                taken, walks = taken + 1, walks + 1
                kinds[walk.said[-1].split(": ")[-1]] += 1
                print(f"seed {seed}, step {taken}: {error!r}; after {'; '.join(walk.said[-8:])}", flush=True)
                walk = Walk([seed, walks], options.tolerance)
        broken += walks
        seconds = time.perf_counter() - begin
        print(f"seed {seed}: {taken} steps, {walks} broken {dict(kinds)}, {seconds:.0f} s", flush=True)
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
