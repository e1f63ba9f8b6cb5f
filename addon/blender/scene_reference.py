# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of a job across its ticks, in which the window may show another one, or which may be deleted."""

import bpy

from ..core.errors import UserError


class SceneReference:
    """Stands for the context's scene and view layer: what Blender evaluates and hides is of those shown."""

    def __init__(self, context):
        self.name, self.uid = context.scene.name, context.scene.session_uid
        self.layer = context.view_layer.name

    def missed(self, context):
        """The name of what the window shows another of, or ""; UserError where the scene was deleted."""
        if context.scene.session_uid == self.uid:
            is_other = context.view_layer.name != self.layer and self.layer in context.scene.view_layers
            return self.layer if is_other else ""
        scene = next((scene for scene in bpy.data.scenes if scene.session_uid == self.uid), None)
        if scene is None:
            raise UserError("{name} was deleted while it was worked on", self)
        return scene.name
