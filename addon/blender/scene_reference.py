# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of a job across its ticks, in which windows may show another one, or which may be deleted."""

import contextlib

import bpy

from ..core.errors import UserError


class SceneReference:
    """Stands for the context's scene and view layer."""

    def __init__(self, context):
        self.name, self.uid = context.scene.name, context.scene.session_uid
        self.layer = context.view_layer.name

    def current(self, context):
        """A context manager in which they are the context's own; UserError where the scene was deleted."""
        if context.scene.session_uid == self.uid and context.view_layer.name == self.layer:
            return contextlib.nullcontext()
        scene = next((scene for scene in bpy.data.scenes if scene.session_uid == self.uid), None)
        if scene is None:
            raise UserError("{name} was deleted while it was worked on", self)
        layer = scene.view_layers.get(self.layer) or scene.view_layers[0]
        return context.temp_override(scene=scene, view_layer=layer)
