# SPDX-License-Identifier: GPL-3.0-or-later
"""check: a report on the machine, Blender, and small problems with known results."""

import platform

import bpy

from ..core.runtime import self_check


def run_check(*_):
    """Prints the report; returns exit code 0 if every result is right, else 1."""
    lines, works = self_check.run()
    print(f"Blender {bpy.app.version_string}, {platform.platform()}")
    print("\n".join([*lines, "everything works" if works else "NOT EVERYTHING WORKS"]), flush=True)
    return 0 if works else 1
