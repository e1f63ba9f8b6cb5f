# SPDX-License-Identifier: GPL-3.0-or-later
"""Says at once when what was installed is the source code: enabled, but without a native library."""

import importlib.util
import sys

import bpy

from .blender import host
from .blender.language import translated
from .core.runtime import native


def is_complete():
    """Whether the library is there; looking for it does not load it."""
    return importlib.util.find_spec("arapfields") is not None


def show():
    lines = translated(native.problem()).split(". ")

    def draw(menu, _):
        for line in lines:
            menu.layout.label(text=line.rstrip(".") + ".")

    bpy.context.window_manager.popup_menu(draw, title="ARAP Fields cannot work", icon="ERROR")


def start():
    if is_complete():
        return
    print(f"ARAP Fields: {native.problem()}", file=sys.stderr, flush=True)
    if host.has_window() and not host.is_module():
        host.start(show, first=0.1)
