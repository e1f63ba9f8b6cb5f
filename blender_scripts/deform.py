# SPDX-License-Identifier: GPL-3.0-or-later
"""Deforms the meshes of one file by handles.

    blender -b -P blender_scripts/deform.py -- --input spot.ply --output bent.ply --handles pose.json
    python blender_scripts/deform.py …          where bpy is installed
    blender --command arapfields deform …       where the extension is installed

See `--help` and docs/command-line.md.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import headless

if __name__ == "__main__":
    headless.main("deform", __file__)
