# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes the animation of a .blend.

    blender -b -P blender_scripts/bake.py -- --input walk.blend --output walk_baked.blend
    python blender_scripts/bake.py …          where bpy is installed
    blender --command arapfields bake …       where the extension is installed

See `--help` and docs/command-line.md.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import headless

if __name__ == "__main__":
    headless.main("bake", __file__)
