# SPDX-License-Identifier: GPL-3.0-or-later
"""In a window the native library is loaded beside the events: the first look at the panel stays quick."""

import bpy

from ..core.runtime import native
from . import timers
from .host import has_window
from .redraw import redraw

INTERVAL = 0.1  # seconds between looks whether it is there


def poll_loading():
    if native.is_loading():
        return INTERVAL
    redraw(bpy.context, "UI")
    return None


def start():
    if has_window():
        native.preload()
        timers.start(poll_loading, first=INTERVAL, persistent=True)
