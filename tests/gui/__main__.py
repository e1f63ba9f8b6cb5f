# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks in Blender's window: `python -m tests.gui [--output FOLDER] [NAME …]`; exit code 1 where one fails.

ARAPFIELDS_WINDOW   command of a Blender with a window (default `blender`), which can import arapfields
Names are the parts of tests/gui/verdicts.py; film takes a file, as film=PINS.blend. By default all parts
without a file run.
"""

import argparse
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

from .verdicts import EXPECTED, JUDGED

WINDOW = shlex.split(os.environ.get("ARAPFIELDS_WINDOW", "blender"))
SIZES = {"film": ("880", "620")}
ALONE = ("film", "tutorial")
SCRIPT = Path(__file__).with_name("window.py")


def groups(names):
    """The parts by Blender process: each of ALONE separately, the others together."""
    names = names or [name for name in EXPECTED if name != "film"]
    unknown = [name for name in names if part_of(name) not in EXPECTED]
    if unknown:
        raise SystemExit(f"no check is named {', '.join(unknown)}; there are {', '.join(EXPECTED)}")
    alone = [[name] for name in names if part_of(name) in ALONE]
    others = [name for name in names if part_of(name) not in ALONE]
    return ([others] if others else []) + alone


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.gui", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--output", default="out/window")
    options = parser.parse_args()
    verdicts = {}
    for group in groups(options.names):
        first = part_of(group[0])
        verdicts |= verdicts_of(group, Path(options.output) / (first if first in ALONE else ""))
    for name, lines in verdicts.items():
        print(f"{name:14} {'as expected' if not lines else 'FAILED: ' + '; '.join(lines)}")
    failed = [name for name, lines in verdicts.items() if lines]
    print(f"FAILED: {'; '.join(failed)}" if failed else "all as expected")
    sys.exit(bool(failed))


def part_of(name):
    return name.split("=")[0]


def verdicts_of(group, folder):
    """{part: lines of failures}; after a part that ends Blender, the others run in a new one."""
    for name in ("checks.json", JUDGED):
        (folder / name).unlink(missing_ok=True)
    size, verdicts = SIZES.get(part_of(group[0]), ("1600", "1000")), {}
    command = [*WINDOW, "--python-use-system-env", "--factory-startup", "--window-geometry", "0", "0", *size]
    command += ["--python-exit-code", "1", "--python", str(SCRIPT), "--", str(folder)]
    while group:
        code, path = subprocess.run([*command, *group]).returncode, folder / JUDGED
        verdicts |= json.loads(path.read_text()) if path.exists() else {}
        left = [name for name in group if part_of(name) not in verdicts]
        if len(left) == len(group):
            return verdicts | {part_of(name): ["nothing was said"] for name in group}
        if not left and code and not any(verdicts.values()):
            verdicts[part_of(group[-1])] = [f"Blender ended with {code}"]
        group = left
    return verdicts


if __name__ == "__main__":
    main()
