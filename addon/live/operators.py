# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import modifier_stack, references
from ..blender.language import translated
from ..blender.object_references import settings_of, source_of
from ..blender.property_definitions import choice
from ..blender.source_operator import ReportingOperator, SourceOperator, with_page
from ..carried import carrying
from ..core.errors import UserError, refuse
from ..core.runtime import jobs
from ..core.settings.choices import LIVE_KINDS, RESULT_KINDS
from ..field_modifier import layers
from ..handles import empties
from ..handles.movers import frozen
from ..jobs.job_operator import unready
from ..results.placement import placement_refusal, take_off
from ..solver import style_settings
from . import sessions


class ARAPFIELDS_OT_live(ReportingOperator, bpy.types.Operator):
    """Have the shape follow its handles, or a style's sliders, while these change"""

    bl_label = "Live"
    guide = "deform"
    bl_options = {"UNDO"}

    kind: choice(LIVE_KINDS, "Kind", "What the shape follows", options={"SKIP_SAVE"})

    @classmethod
    def description(cls, context, properties):
        kind = getattr(properties, "kind", "")
        if kind == "STYLIZE":
            return with_page(translated("Show the style on the object while its settings change"), "stylize")
        if kind == "DEFORM":
            return with_page(translated("Let the shape follow its handles while they move"), "deform")
        return super().description(context, properties)

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
        earlier, was_live = sessions.live.get(source.session_uid), settings_of(source).live_kind
        moved = carrying.with_carried(source)
        before = references.referred(moved)
        try:
            # What a refused start takes away comes back without a step of undo.
            with references.unused_kept():
                self.start(context, source, wait, earlier)
        except (UserError, ValueError) as error:
            if earlier is not None and not sessions.is_live(source):
                sessions.go_back(context, source, earlier.former, earlier.kind)
            if was_live and not settings_of(source).live_kind:  # it cannot go on
                references.push("Live")
            else:
                references.push_new("Live", moved, before)
            return self.refuse(error)
        return {"FINISHED"}

    def start(self, context, source, wait, earlier):
        """`earlier`: the session that goes on if this one is refused, or None."""
        if self.kind == "DEFORM" and not empties.used(source):
            raise UserError("{name} has no handle; add one in the panel's Handles section", source)
        is_style = self.kind == "STYLIZE"
        refuse(style_settings.refusal(source) if is_style else frozen(empties.used(source)))
        context.view_layer.update()
        sessions.begin(context, source, self.kind, goes_back=earlier is not None)
        if wait:
            shared = earlier.display if earlier is not None else None
            sessions.update_one(context, source.session_uid, wait, shared=shared)
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


class ARAPFIELDS_OT_remove_result(SourceOperator, bpy.types.Operator):
    """Give the object its shape from before this result, and end its live mode; handles and settings stay"""

    bl_label = "Remove Result"
    bl_options = {"REGISTER", "UNDO"}
    guide = "results"

    kind: choice(RESULT_KINDS, "Kind", "Which result is removed")

    @classmethod
    def refuses(cls, source):
        if sessions.is_live(source) or modifier_stack.top(source) is not None:
            return None
        return UserError("{name} has no ARAP Fields modifier", source)

    def change(self, context, source):
        if sessions.is_live(source, self.kind):
            sessions.live[source.session_uid].keeps_shape = False
            sessions.end(context, source)
            if layers.carrying(source, self.kind) is None:
                return
        elif sessions.is_live(source):
            raise UserError("{name} is live; end live mode first", source)
        if layers.carrying(source, self.kind) is None:
            raise UserError("{name} has no such result", source)
        if layers.carrying(source, self.kind) != modifier_stack.top(source):
            raise UserError("Another result of {name} lies on this one; remove that first", source)
        reason = take_off(context, source)
        if reason is not None:
            self.report({"WARNING"}, translated(reason))


CLASSES = [ARAPFIELDS_OT_live, ARAPFIELDS_OT_live_keep, ARAPFIELDS_OT_remove_result]
