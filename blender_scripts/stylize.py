# SPDX-License-Identifier: GPL-3.0-or-later
"""Turns the meshes of one file towards a style.

    blender -b -P blender_scripts/stylize.py -- --input spot.ply --output cubic.ply --style cube
    python blender_scripts/stylize.py …          where bpy is installed
    blender --command arapfields stylize …       where the extension is installed

`--help` tells the flags; docs/command-line.md more.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import headless

if __name__ == "__main__":
    headless.main("stylize", __file__)
