# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's window and event loop: whether there is one, timers, redraws, and loading beside it."""

import bpy

from ..core.runtime import native
from ..names import CATEGORY

# Whether Blender runs as a module, and whether it has a window.


def is_module():
    """Whether Blender runs as Python's module bpy; Blender 4.2 lacks bpy.app.module: no binary_path then."""
    return getattr(bpy.app, "module", not bpy.app.binary_path)


def has_window():
    """Whether there is a window: events, timers and drawing."""
    return not bpy.app.background


# Registration of bpy.app.timers: functions that Blender calls between events until they return None.

_started = []


def start(function, first=0.0, persistent=False):
    """Registers a timer that first runs after `first` seconds; a `persistent` one survives loading a file."""
    if not bpy.app.timers.is_registered(function):
        bpy.app.timers.register(function, first_interval=first, persistent=persistent)
    if function not in _started:
        _started.append(function)


def running():
    return [function for function in _started if bpy.app.timers.is_registered(function)]


def clear():
    """Unregisters all timers of the extension."""
    for function in running():
        bpy.app.timers.unregister(function)
    _started.clear()


def start_events(context, seconds):
    """A window timer that sends events to modal operators every `seconds`."""
    return context.window_manager.event_timer_add(seconds, window=context.window)


def stop_events(timer):
    bpy.context.window_manager.event_timer_remove(timer)


# Tags regions for redraw.


def redraw(context, *kinds):
    """Tags regions of these types in every 3D view for redraw; of sidebars those that show the panel."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type in kinds and shows_panel(region):
                        region.tag_redraw()


def shows_panel(region):
    """False for a sidebar that is closed or shows another tab."""
    if region.type != "UI":
        return True
    return region.width > 1 and getattr(region, "active_panel_category", CATEGORY) == CATEGORY


# Loads the native library on a thread in Blender with a window, so that the panel's first draw is quick.

INTERVAL = 0.1  # seconds between checks whether it is loaded


def poll_loading():
    if native.is_loading():
        return INTERVAL
    redraw(bpy.context, "UI")
    return None


def start_loading():
    if has_window():
        native.preload()
        start(poll_loading, first=INTERVAL, persistent=True)
