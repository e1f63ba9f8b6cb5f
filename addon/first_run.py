# SPDX-License-Identifier: GPL-3.0-or-later
"""The first run: what was installed, and where the panel is."""

import importlib.util
import sys
import time

import blf
import bpy

from .blender import host
from .blender.host import redraw
from .blender.language import translated
from .blender.user_preferences import preferences
from .core.runtime import native

# Says once, when the extension is first enabled, where it is to be found.
#
# The text is in the 3D views for a while, where it takes no key and hides behind no window. The while begins
# when the Preferences are closed, where the extension was installed.

SECONDS = 40.0
INTERVAL = 0.5  # seconds between looks at the windows
SIZE, LEFT, BOTTOM = 14, 90, 40  # of the text and its place in a 3D view, in pixels at UI scale 1


class Welcome:
    """`until`: when the texts go, in seconds of time.monotonic()."""

    until = 0.0

    def clear(self):
        self.until = 0.0

    def __bool__(self):
        return self.until > 0.0


welcome = Welcome()


def show():
    stored = preferences()
    if stored is None or stored.was_welcomed:
        return
    stored.was_welcomed = bpy.context.preferences.is_dirty = True  # else Blender would not save it
    welcome.until = time.monotonic() + SECONDS
    redraw(bpy.context, "WINDOW")
    host.start(end, first=INTERVAL)


def end():
    """Timer callback."""
    if are_preferences_open():
        welcome.until = time.monotonic() + SECONDS
    if welcome.until > time.monotonic():
        return INTERVAL
    redraw(bpy.context, "WINDOW")
    return None


def are_preferences_open():
    """Whether there is a window of the Preferences."""
    screens = [window.screen for window in bpy.context.window_manager.windows]
    return any(s.is_temporary and any(a.type == "PREFERENCES" for a in s.areas) for s in screens)


def lines():
    """The texts that are shown now."""
    if time.monotonic() >= welcome.until:
        return []
    return [
        translated("ARAP Fields: take the pin tool, below Measure in the toolbar, and drag a mesh"),
        translated("All else is in the sidebar: press N and choose the tab ARAP Fields"),
        translated("The same is in the menu Object › ARAP Fields, and F3 finds it"),
    ]


def draw():
    scale = bpy.context.preferences.system.ui_scale
    blf.size(0, SIZE * scale)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 5, 0.0, 0.0, 0.0, 0.9)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    for row, text in enumerate(reversed(lines())):
        blf.position(0, LEFT * scale, (BOTTOM + 1.6 * SIZE * row) * scale, 0)
        blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


def start():
    if host.has_window() and not host.is_module():
        host.start(show, first=1.0)


# Says at once when what was installed is the source code: enabled, but without a native library.


def is_complete():
    """Whether the library is there; looking for it does not load it."""
    return importlib.util.find_spec("arapfields") is not None


def show_problem():
    lines = translated(native.problem()).split(". ")

    def draw(menu, _):
        for line in lines:
            menu.layout.label(text=line.rstrip(".") + ".")

    bpy.context.window_manager.popup_menu(draw, title="ARAP Fields cannot work", icon="ERROR")


def check_installation():
    if is_complete():
        return
    print(f"ARAP Fields: {native.problem()}", file=sys.stderr, flush=True)
    if host.has_window() and not host.is_module():
        host.start(show_problem, first=0.1)
