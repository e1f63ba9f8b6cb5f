# SPDX-License-Identifier: GPL-3.0-or-later
"""Says at once when what was installed is the source code: enabled, but without a native library."""

import importlib.util
import sys

import bpy

from .blender import host
from .blender.language import translated
from .core.runtime import native


def is_whole():
    """Whether the library is there; looking for it does not load it."""
    return importlib.util.find_spec("arapfields") is not None


def show():
    lines = translated(native.problem()).split(". ")

    def draw(menu, _):
        for line in lines:
            menu.layout.label(text=line.rstrip(".") + ".")

    bpy.context.window_manager.popup_menu(draw, title="ARAP Fields cannot work", icon="ERROR")


def register():
    if is_whole():
        return
    print(f"ARAP Fields: {native.problem()}", file=sys.stderr, flush=True)
    if not bpy.app.background and not host.is_module():
        bpy.app.timers.register(show, first_interval=0.1)


def unregister():
    if bpy.app.timers.is_registered(show):
        bpy.app.timers.unregister(show)
