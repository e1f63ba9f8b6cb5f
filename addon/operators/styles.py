# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..bridge.language import translated
from ..bridge.lookup import refusal, settings_of, source_of
from ..names import Op
from ..properties.settings import style


class ARAPFIELDS_OT_set_style(bpy.types.Operator):
    """Choose this style for the object"""

    bl_idname = Op.SET_STYLE
    bl_label = "Choose Style"
    bl_options = {"INTERNAL", "UNDO"}

    style: style()

    @classmethod
    def poll(cls, context):
        reason = refusal(source_of(context))
        if reason:
            cls.poll_message_set(translated(reason))
        return not reason

    def execute(self, context):
        settings_of(source_of(context)).stylize.style = self.style
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_set_style]
