# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether Blender runs as a module, and whether it has a window."""

import bpy


def is_module():
    """Whether Blender runs as Python's module bpy; Blender 4.2 lacks bpy.app.module: no binary_path then."""
    return getattr(bpy.app, "module", not bpy.app.binary_path)


def has_window():
    """Whether there is a window: events, timers and drawing."""
    return not bpy.app.background
