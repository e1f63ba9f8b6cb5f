# SPDX-License-Identifier: GPL-3.0-or-later
"""Gives the meshes of a .blend weights of its armature's bones.

    blender -b -P blender_scripts/skin.py -- --input body.blend --output skinned.blend
    python blender_scripts/skin.py …          where bpy is installed
    blender --command arapfields skin …       where the extension is installed

See `--help` and docs/command-line.md.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import headless

if __name__ == "__main__":
    headless.main("skin", __file__)
