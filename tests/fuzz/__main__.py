# SPDX-License-Identifier: GPL-3.0-or-later
"""Long fuzzing: `python -m tests.fuzz [--count 20000] [--seed 0] [TARGET …]`; exit code 1 on failure."""

import argparse
import sys
import time

from .run import run_target, unreached

FILES = ("fields", "sdfs", "meshes", "handles", "normals", "records", "commandline")


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", default=["api", *FILES], metavar="TARGET")
    parser.add_argument("--count", type=int, default=20000, help="cases of each target [20000]")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    failed, texts = False, set()
    for target in options.targets:
        begin = time.perf_counter()
        findings = run_target(target, options.seed, options.count)
        outcomes = ", ".join(f"{count} {name}" for name, count in findings.outcomes.most_common())
        print(f"{target}: {outcomes}, in {time.perf_counter() - begin:.0f} s", flush=True)
        for number, text in findings.failures[:20]:
            print(f"  case {number}: {text}\n", flush=True)
        failed |= bool(findings.failures)
        texts |= findings.texts
    if {"fields", "sdfs"} <= set(options.targets):
        for name, line, parts in unreached(texts):
            print(f"not reached: native/io/{name}.cpp:{line} {parts}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
