# SPDX-License-Identifier: GPL-3.0-or-later
"""What kind of Blender this is."""

import bpy


def is_module():
    """Whether Blender runs as Python's module bpy; Blender 4.2 tells by having no program of its own."""
    return getattr(bpy.app, "module", not bpy.app.binary_path)


def has_window():
    """Whether there is a window: events, timers and drawing."""
    return not bpy.app.background
