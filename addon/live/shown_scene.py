# SPDX-License-Identifier: GPL-3.0-or-later
"""The window's scene and its frame. Each scene has a depsgraph of its own, and Blender copies evaluated
transforms to the original objects only from the active one: after a switch they are still those of the scene
before, and after a jump to a frame, until the window evaluates it, those of the frame before."""

import bpy

from ..blender.evaluation import depsgraph_of, updated
from ..solver.frame_range import involved
from .playback import scene_frame


class ShownScene:
    """`uid`: session_uid of the scene at the last check; None before the first one."""

    uid = None

    def follow(self, context, sessions):
        """After a switch of scenes, tags and evaluates the objects that live shapes follow; evaluates a frame
        that the scene was set to, if the window has not done so yet."""
        before, self.uid = self.uid, context.scene.session_uid
        if before in (None, self.uid):
            if sessions and scene_frame(depsgraph_of(context).scene_eval) != scene_frame(context.scene):
                updated(context.view_layer)
            return
        for session in sessions:
            source = session.source.find()
            for item in () if source is None else involved(source, session.kind):
                item.update_tag(refresh={"TIME"} if isinstance(item, bpy.types.Object) else set())
            session.edits.may_have_moved = session.reader.moves_by_itself
        updated(context.view_layer)
