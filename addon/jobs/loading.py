# SPDX-License-Identifier: GPL-3.0-or-later
"""In a window the native library is loaded beside the events: the first look at the panel stays quick."""

import bpy

from ..core.runtime import native
from .modal import redraw

LOOK = 0.1  # seconds between looks whether it is there


def look():
    if native.is_loading():
        return LOOK
    redraw(bpy.context, "UI")
    return None


def register():
    if not bpy.app.background:
        native.preload()
        bpy.app.timers.register(look, first_interval=LOOK, persistent=True)


def unregister():
    if bpy.app.timers.is_registered(look):
        bpy.app.timers.unregister(look)
