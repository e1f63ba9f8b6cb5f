# SPDX-License-Identifier: GPL-3.0-or-later
"""Common part of deform.py, stylize.py, batch.py and the like, which run commands of the add-on.

The add-on is the installed extension if that is enabled, else that of this repository.
"""

import contextlib
import importlib
import os
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def addon():
    """The add-on's package, registered."""
    import bpy

    for entry in bpy.context.preferences.addons:
        name = entry.module
        if re.fullmatch(r"bl_ext\.\w+\.arapfields", name) and hasattr(bpy.types.Object, "arapfields"):
            return importlib.import_module(name)
    sys.path.insert(0, str(ROOT))
    package = importlib.import_module("addon")
    package.register()
    return package


def main(verb, script):
    """Runs the verb with the arguments after `--` (in Blender) or all of them (in Python), and exits."""
    try:
        import bpy
    except ImportError as error:
        sys.exit(f"{script}: run it as `blender -b -P {script} -- …`, or where bpy is installed ({error})")
    arguments = sys.argv[1:]
    if bpy.app.binary_path:  # the program, not the module
        arguments = arguments[arguments.index("--") + 1 :] if "--" in arguments else []
    run = importlib.import_module(f"{addon().__name__}.commands.main").run
    code = run([verb, *arguments], script)
    sys.stdout.flush()
    if bpy.app.binary_path:
        sys.exit(code)
    # bpy may deadlock at the end of Python.
    sys.stderr.flush()
    with contextlib.suppress(OSError):
        os.rmdir(bpy.app.tempdir)  # left empty by Blender
    os._exit(code or 0)
