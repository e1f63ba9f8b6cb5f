# SPDX-License-Identifier: GPL-3.0-or-later
"""The window's scene. Each scene has a depsgraph of its own, and Blender copies evaluated transforms to the
original objects only from the active one: after a switch they are still those of the scene before."""

import bpy

from ..blender.evaluation import updated
from ..solver.frame_range import involved


class ShownScene:
    """`uid`: session_uid of the scene at the last check; None before the first one."""

    uid = None

    def follow(self, context, sessions):
        """After a switch of scenes, tags and evaluates the objects that live shapes follow."""
        before, self.uid = self.uid, context.scene.session_uid
        if before in (None, self.uid):
            return
        for session in sessions:
            source = session.source.find()
            for item in () if source is None else involved(source, session.kind):
                item.update_tag(refresh={"TIME"} if isinstance(item, bpy.types.Object) else set())
            session.edits.may_have_moved = session.reader.moves_by_itself
        updated(context.view_layer)
