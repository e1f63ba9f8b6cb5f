# SPDX-License-Identifier: GPL-3.0-or-later
"""Deforms or stylizes every file of a folder in parallel, and skips existing results.

    blender -b -P blender_scripts/batch.py -- --style cube --input meshes --output cubic --jobs 2
    python blender_scripts/batch.py …          where bpy is installed
    blender --command arapfields batch …       where the extension is installed

See `--help` and docs/command-line.md.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import headless

if __name__ == "__main__":
    headless.main("batch", __file__)
