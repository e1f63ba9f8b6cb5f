# SPDX-License-Identifier: GPL-3.0-or-later
"""The one way to be called again: functions that Blender calls between events until they return None."""

import bpy

_started = []


def start(function, first=0.0, persistent=False):
    """Has Blender call `function` after `first` seconds; a `persistent` one goes on when a file is loaded."""
    if not bpy.app.timers.is_registered(function):
        bpy.app.timers.register(function, first_interval=first, persistent=persistent)
    if function not in _started:
        _started.append(function)


def running():
    return [function for function in _started if bpy.app.timers.is_registered(function)]


def clear():
    """Stops all of them."""
    for function in running():
        bpy.app.timers.unregister(function)
    _started.clear()


def start_events(context, seconds):
    """A timer whose events reach the window's modal operators, so many seconds apart."""
    return context.window_manager.event_timer_add(seconds, window=context.window)


def stop_events(timer):
    bpy.context.window_manager.event_timer_remove(timer)
