# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the native library on a thread in Blender with a window, so that the panel's first draw is quick."""

import bpy

from ..core.runtime import native
from . import timers
from .host import has_window
from .redraw import redraw

INTERVAL = 0.1  # seconds between checks whether it is loaded


def poll_loading():
    if native.is_loading():
        return INTERVAL
    redraw(bpy.context, "UI")
    return None


def start():
    if has_window():
        native.preload()
        timers.start(poll_loading, first=INTERVAL, persistent=True)
