# SPDX-License-Identifier: GPL-3.0-or-later
"""Registration of bpy.app.timers: functions that Blender calls between events until they return None."""

import bpy

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
