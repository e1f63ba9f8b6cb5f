# SPDX-License-Identifier: GPL-3.0-or-later
"""Says once, when the extension is first enabled, where it is to be found."""

import bpy

from .blender import host, timers
from .blender.user_preferences import preferences


def show():
    stored = preferences()
    if stored is None or stored.was_welcomed:
        return
    stored.was_welcomed = bpy.context.preferences.is_dirty = True  # else Blender would not save it

    def draw(menu, _):
        menu.layout.label(text="Over the 3D view press N and choose the tab ARAP Fields")
        menu.layout.label(text="The same is in the menu Object › ARAP Fields, and F3 finds it")

    bpy.context.window_manager.popup_menu(draw, title="ARAP Fields", icon="INFO")


def start():
    if host.has_window() and not host.is_module():
        timers.start(show, first=1.0)
