# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that the window shows. Blender evaluates each for itself, and writes the objects' places back to
the file only from the one that is shown: after a switch they are those of the scene before."""

import bpy

from ..blender.evaluation import updated
from ..solver.frame_range import involved


class ShownScene:
    """Which scene was looked at last; None before the first look."""

    uid = None

    def follow(self, context, sessions):
        """Where the window has come to another scene, has Blender place there what live shapes follow."""
        before, self.uid = self.uid, context.scene.session_uid
        if before in (None, self.uid):
            return
        for session in sessions:
            source = session.source.find()
            for item in () if source is None else involved(source, session.kind):
                item.update_tag(refresh={"TIME"} if isinstance(item, bpy.types.Object) else set())
            session.edits.may_have_moved = session.reader.moves_by_itself
        updated(context.view_layer)
