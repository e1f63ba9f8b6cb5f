# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over every 3D viewport, while the extension is on and there is a window."""

import bpy


class ViewportDrawing:
    """Calls `draw` after each viewport's own drawing, from register() to unregister()."""

    def __init__(self, draw):
        self._draw, self._handler = draw, None

    def register(self):
        if not bpy.app.background:
            add = bpy.types.SpaceView3D.draw_handler_add
            self._handler = add(self._draw, (), "WINDOW", "POST_VIEW")

    def unregister(self):
        if self._handler is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handler, "WINDOW")
            self._handler = None
