# SPDX-License-Identifier: GPL-3.0-or-later
"""Stylizes the meshes of one file.

    blender -b -P blender_scripts/stylize.py -- --input spot.ply --output cubic.ply --style cube
    python blender_scripts/stylize.py …          where bpy is installed
    blender --command arapfields stylize …       where the extension is installed

See `--help` and docs/command-line.md.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import headless

if __name__ == "__main__":
    headless.main("stylize", __file__)
