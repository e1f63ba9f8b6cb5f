# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import mesh_arrays
from ..blender.guide import Guided
from ..blender.language import translated
from ..blender.object_references import refusal, source_of
from ..core.errors import UserError
from ..core.runtime import jobs, native
from ..core.settings.choices import LIVE_KINDS
from ..handles import empties
from ..jobs.job_operator import busy
from ..names import Op
from ..results.placement import placement_refusal
from . import sessions


class ARAPFIELDS_OT_live(Guided, bpy.types.Operator):
    """Let the shape follow handles or style while these change; again to stop, which takes that back"""

    bl_idname = Op.LIVE
    bl_label = "Live"
    guide = "deform"
    bl_options = {"UNDO"}

    kind: bpy.props.EnumProperty(
        items=LIVE_KINDS, name="Kind", description="What the shape follows", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        source = source_of(context)
        reason = native.problem() or refusal(source) or busy() or mesh_arrays.refusal(source)
        if not reason and not sessions.is_live(source):
            reason = placement_refusal(source)
        if reason:
            cls.poll_message_set(translated(reason))
        return not reason

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
        try:
            if self.kind == "DEFORM" and not empties.used(source):
                raise UserError(
                    "{name} has no handle; add one in the panel's Handles section", name=source.name
                )
            context.view_layer.update()
            sessions.begin(context, source, self.kind)
        except (UserError, ValueError) as error:
            self.report({"ERROR"}, translated(error))
            return {"CANCELLED"}
        if wait:
            sessions.update(context, wait)
            if not sessions.is_live(source):
                self.report({"ERROR"}, jobs.messages()[-1][1])
                return {"CANCELLED"}
        return {"FINISHED"}


class ARAPFIELDS_OT_live_keep(Guided, bpy.types.Operator):
    """End live mode and keep the shape as the result"""

    bl_idname = Op.LIVE_KEEP
    bl_label = "Keep Shape"
    guide = "deform"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        if not sessions.is_live(source_of(context)):
            cls.poll_message_set(translated("The object is not live"))
            return False
        return True

    def execute(self, context):
        source = source_of(context)
        try:
            item = sessions.end(context, source, keep=True)
        except UserError as error:
            self.report({"ERROR"}, translated(error))
            return {"CANCELLED"}
        self.report({"INFO"}, translated("{name} kept", name=item.name))
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_live, ARAPFIELDS_OT_live_keep]
