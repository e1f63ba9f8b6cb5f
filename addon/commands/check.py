# SPDX-License-Identifier: GPL-3.0-or-later
"""check: one report of the machine, of Blender, and of small problems whose answers are known."""

import platform

import bpy

from ..core.runtime import self_check


def run_check(*_):
    """Prints the report; exit code 0 when everything is right, else 1."""
    lines, works = self_check.run()
    print(f"Blender {bpy.app.version_string}, {platform.platform()}")
    print("\n".join([*lines, "everything works" if works else "NOT EVERYTHING WORKS"]), flush=True)
    return 0 if works else 1
