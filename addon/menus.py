# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands in Blender's own menus and headers."""

import bpy

from .jobs import status_bar

PLACES = {"STATUSBAR_HT_header": status_bar.draw}  # bpy.types → what is drawn at its end


def register():
    for name, draw in PLACES.items():
        getattr(bpy.types, name).append(draw)


def unregister():
    for name, draw in PLACES.items():
        getattr(bpy.types, name).remove(draw)
