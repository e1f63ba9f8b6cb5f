# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's extension tool, run in a separate process by this environment's bpy."""

import subprocess
import sys

CODE = """
import sys, bpy, addon_utils
from bl_pkg import bl_extension_cli
sys.exit(bl_extension_cli.cli_extension_handler(sys.argv[1:]))
"""


def extension_tool(*arguments):
    """Runs `blender --command extension …`; RuntimeError with its output if it fails."""
    command = [sys.executable, "-c", CODE, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        said = f"{done.stdout}{done.stderr}".strip()[-4000:]
        raise RuntimeError(f"Blender's extension {arguments[0]} fails:\n{said}")
    return done.stdout
