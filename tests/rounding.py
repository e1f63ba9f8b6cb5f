# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs tests as other processors would round: `python -m tests.rounding [options] [TESTS …]`.

Each condition is an instruction set that this processor has (ARAPFIELDS_SIMD, and libtorch's and MKL's of the
same age), with shapes as they are or moved by a ten-millionth of their size (support/geometry/nudge.py). The
best one with shapes as they are is that of `make test` and runs if --levels names it. Exit code 1 if a test
fails under one of them.
"""

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LEVELS = {"avx512": ["baseline", "avx2", "avx512"], "avx2": ["baseline", "avx2"]}
LEVELS |= {"neon": ["baseline", "neon"], "baseline": ["baseline"]}
LIBRARIES = {
    "baseline": {"ATEN_CPU_CAPABILITY": "default", "MKL_CBWR": "COMPATIBLE"},
    "avx2": {"ATEN_CPU_CAPABILITY": "avx2", "MKL_CBWR": "AVX2"},
}
FOLDERS = ("native", "python", "addon_core", "blender", "fuzz")
PARTS = 12  # of the files, each some minutes on two processors


def conditions(best, levels, nudges):
    """[(level, number of the displacement, 0 for none)]"""
    every = [(level, nudge) for nudge in nudges for level in levels or LEVELS[best]]
    return every if levels else [one for one in every if one != (best, 0)]


def part_of(every, files, number):
    """One condition, and every PARTS-th file: all of them in turn as the number rises."""
    number, which = divmod(number, len(every))
    return [every[which]], files[number % PARTS :: PARTS]


def failed_under(level, nudge, tests, pytest_options):
    """Lines of pytest's summary that name what failed, or its last ones if it ended otherwise."""
    command = [sys.executable, "-m", "pytest", "-m", "not slow", *pytest_options, *map(str, tests)]
    environment = {**os.environ, **LIBRARIES.get(level, {})}
    environment |= {"ARAPFIELDS_SIMD": level, "ARAPFIELDS_NUDGE": str(nudge)}
    lines = []
    with subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            print(line, end="", flush=True)
            lines.append(line.rstrip())
    failed = [line for line in lines if re.match(r"(FAILED|ERROR) ", line)]
    nothing_to_run = process.returncode == 5
    return failed if failed or process.returncode == 0 or nothing_to_run else lines[-5:]


def main():
    import arapfields as af

    parser = argparse.ArgumentParser(prog="python -m tests.rounding", description=__doc__)
    parser.add_argument("tests", nargs="*", metavar="TESTS", help="files or tests [all with numbers in them]")
    parser.add_argument("--levels", type=str.split, help="instruction sets, as 'baseline avx2' [all]")
    parser.add_argument("--nudges", type=str.split, default=["0", "1"], help="displacements; 0: none ['0 1']")
    parser.add_argument(
        "--part", type=int, help=f"one condition of all, and one of {PARTS} parts of the files"
    )
    parser.add_argument("--pytest", type=str.split, default=[], help="its options, in one word")
    options = parser.parse_args()
    every = conditions(af.simd_level(), options.levels, [int(nudge) for nudge in options.nudges])
    tests = options.tests or sorted(
        path.relative_to(ROOT) for folder in FOLDERS for path in (ROOT / "tests" / folder).glob("test_*.py")
    )
    if options.part is not None:
        every, tests = part_of(every, tests, options.part)
    found = {}
    for level, nudge in every:
        name = f"{af.backend()}, {level}, shapes {f'moved ({nudge})' if nudge else 'as they are'}"
        print(f"== {name}", flush=True)
        found[name] = failed_under(level, nudge, tests, options.pytest)
    print("\n== Tests at other roundings")
    for name, failed in found.items():
        print(f"{name}: {f'{len(failed)} failed' if failed else 'passed'}", *failed, sep="\n  ")
    sys.exit(any(found.values()))


if __name__ == "__main__":
    main()
