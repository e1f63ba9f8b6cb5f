# SPDX-License-Identifier: GPL-3.0-or-later
"""A script that registers the add-on in Python's own bpy and simply ends must end."""

import subprocess
import sys

from support.blender.inside import require_bpy

EXIT_LIMIT = 60  # seconds; it hung for ever where it failed
SCRIPT = "import bpy, addon; addon.register(); bpy.ops.mesh.primitive_monkey_add(); print('end')"


def test_a_script_with_the_addon_ends(user_folder):
    require_bpy()
    command = [sys.executable, "-c", SCRIPT]
    result = subprocess.run(command, env=user_folder, capture_output=True, text=True, timeout=EXIT_LIMIT)
    assert result.returncode == 0, result.stderr
    assert "end" in result.stdout
