# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.language import translated
from ..blender.object_references import source_of
from ..blender.property_definitions import choice
from ..blender.source_operator import ReportingOperator
from ..core.errors import UserError, refuse
from ..core.runtime import jobs
from ..core.settings.choices import LIVE_KINDS
from ..handles import empties
from ..handles.movers import frozen
from ..jobs.job_operator import unready
from ..results.placement import placement_refusal
from ..solver import style_settings
from . import sessions


class ARAPFIELDS_OT_live(ReportingOperator, bpy.types.Operator):
    """Let the shape follow handles or style while these change; again to stop, which keeps a shape of pins"""

    bl_label = "Live"
    guide = "deform"
    bl_options = {"UNDO"}

    kind: choice(LIVE_KINDS, "Kind", "What the shape follows", options={"SKIP_SAVE"})

    @classmethod
    def obstacle(cls, context):
        source = source_of(context)
        return unready(source) or (None if sessions.is_live(source) else placement_refusal(source))

    def execute(self, context):
        return self.toggle(context, sessions.WAIT)

    def invoke(self, context, event):
        return self.toggle(context, sessions.WAIT if bpy.app.background else 0.0)

    def toggle(self, context, wait):
        """`wait`: seconds at most for the first shape; a window does not wait."""
        source = source_of(context)
        if sessions.is_live(source, self.kind):
            sessions.end(context, source)
            return {"FINISHED"}
        earlier = sessions.live.get(source.session_uid)
        try:
            self.start(context, source, wait)
        except (UserError, ValueError) as error:
            if earlier is not None and not sessions.is_live(source):
                sessions.go_back(context, source, earlier.former, earlier.kind)
            return self.refuse(error)
        return {"FINISHED"}

    def start(self, context, source, wait):
        if self.kind == "DEFORM" and not empties.used(source):
            raise UserError("{name} has no handle; add one in the panel's Handles section", source)
        is_style = self.kind == "STYLIZE"
        refuse(style_settings.refusal(source) if is_style else frozen(empties.used(source)))
        context.view_layer.update()
        sessions.begin(context, source, self.kind)
        if wait:
            sessions.update_one(context, source.session_uid, wait)
        if not sessions.is_live(source):
            raise UserError("{error}", error=jobs.messages()[-1][1])


class ARAPFIELDS_OT_live_keep(ReportingOperator, bpy.types.Operator):
    """End live mode and keep the shape as the result"""

    bl_label = "Keep Shape"
    guide = "deform"
    bl_options = {"UNDO"}

    @classmethod
    def obstacle(cls, context):
        return None if sessions.is_live(source_of(context)) else UserError("The object is not live")

    def change(self, context, source):
        return translated("{name} kept", name=sessions.end(context, source, keep=True).name)


CLASSES = [ARAPFIELDS_OT_live, ARAPFIELDS_OT_live_keep]
