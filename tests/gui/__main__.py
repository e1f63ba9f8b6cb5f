# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks in Blender's window: `python -m tests.gui [--output FOLDER] [NAME …]`; exit code 1 where one fails.

ARAPFIELDS_WINDOW   command of a Blender with a window (default `blender`), which can import arapfields
Names are the parts of tests/gui/verdicts.py; film and pose take a file, as film=PINS.blend. Without names all
run that need none.
"""

import argparse
import os
import shlex
import subprocess
import sys
from pathlib import Path

from .verdicts import EXPECTED

WINDOW = shlex.split(os.environ.get("ARAPFIELDS_WINDOW", "blender"))
SIZES = {"film": ("880", "620")}
ALONE = ("film", "pose", "walk", "tutorial")
SCRIPT = Path(__file__).with_name("window.py")


def groups(names):
    """What runs in one Blender: each of ALONE by itself, the others together."""
    names = names or [name for name in EXPECTED if "-" not in name and name not in ("film", "pose")]
    unknown = [name for name in names if name.split("=")[0] not in EXPECTED]
    if unknown:
        raise SystemExit(f"no check is named {', '.join(unknown)}; there are {', '.join(EXPECTED)}")
    alone = [[name] for name in names if name.split("=")[0] in ALONE]
    others = [name for name in names if name.split("=")[0] not in ALONE]
    return ([others] if others else []) + alone


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.gui", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--output", default="out/window")
    options = parser.parse_args()
    failed = []
    for group in groups(options.names):
        first = group[0].split("=")[0]
        size = SIZES.get(first, ("1600", "1000"))
        command = [
            *WINDOW,
            "--python-use-system-env",
            "--factory-startup",
            "--window-geometry",
            "0",
            "0",
            *size,
        ]
        command += ["--python-exit-code", "1", "--python", str(SCRIPT), "--"]
        folder = Path(options.output) / (first if first in ALONE else "")
        if subprocess.run([*command, str(folder), *group]).returncode:
            failed.append(" ".join(group))
    print(f"FAILED: {'; '.join(failed)}" if failed else "all as expected")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
