# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.guide import Guided
from ..blender.language import translated
from ..blender.object_references import refusal, settings_of, source_of
from ..names import Op
from .painted import PRESETS


class ARAPFIELDS_OT_stiffness_preset(Guided, bpy.types.Operator):
    """Make the painted part of this material: the active vertex group where none is chosen"""

    bl_idname = Op.STIFFNESS_PRESET
    bl_label = "Material"
    guide = "characters"
    bl_options = {"REGISTER", "UNDO"}

    material: bpy.props.EnumProperty(
        items=tuple((key, label, tip) for key, (label, tip, _) in PRESETS.items()),
        name="Material",
        description="How stiff the painted part is",
    )

    @classmethod
    def poll(cls, context):
        source = source_of(context)
        reason = refusal(source)
        if not reason and not source.vertex_groups:
            reason = translated("{name} has no vertex group", name=source.name)
        if reason:
            cls.poll_message_set(translated(reason))
        return not reason

    def execute(self, context):
        source = source_of(context)
        settings = settings_of(source).stiffness
        settings.group = settings.group or source.vertex_groups.active.name
        settings.bend_group = settings.group
        settings.times, settings.bend_times = PRESETS[self.material][2]
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_stiffness_preset]
