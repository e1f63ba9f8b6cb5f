# SPDX-License-Identifier: GPL-3.0-or-later
"""Reference to a job's scene across its ticks: the window may switch scenes, or the scene may be deleted."""

import bpy

from ..core.errors import UserError


class SceneReference:
    """Refers to the context's scene and view layer, on which evaluation and visibility depend."""

    def __init__(self, context):
        self.name, self.uid = context.scene.name, context.scene.session_uid
        self.layer = context.view_layer.name

    def missed(self, context):
        """The name of the scene or view layer that the window no longer shows, or ""; UserError if the scene
        was deleted."""
        if context.scene.session_uid == self.uid:
            is_other = context.view_layer.name != self.layer and self.layer in context.scene.view_layers
            return self.layer if is_other else ""
        scene = next((scene for scene in bpy.data.scenes if scene.session_uid == self.uid), None)
        if scene is None:
            raise UserError("{name} was deleted while it was worked on", self)
        return scene.name
