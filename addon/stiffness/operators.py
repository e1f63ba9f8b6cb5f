# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import vertex_groups
from ..blender.object_references import settings_of
from ..blender.property_definitions import choice
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError
from .painted import PRESETS


class ARAPFIELDS_OT_stiffness_preset(SourceOperator, bpy.types.Operator):
    """Make the painted part of this material: the active vertex group where none is chosen"""

    bl_label = "Stiffness Preset"
    guide = "characters"
    bl_options = {"REGISTER", "UNDO"}

    material: choice(
        tuple((key, label, tip) for key, (label, tip, _) in PRESETS.items()),
        "Stiffness Preset",
        "How stiff the painted part is",
    )

    @classmethod
    def refuses(cls, source):
        return None if source.vertex_groups else UserError("{name} has no vertex group", source)

    def change(self, context, source):
        settings = settings_of(source).stiffness
        group = settings.group or vertex_groups.active_name(source)
        if not group:
            raise vertex_groups.none_chosen(source)
        settings.group = group
        settings.bend_group = settings.group
        settings.times, settings.bend_times = PRESETS[self.material][2]


CLASSES = [ARAPFIELDS_OT_stiffness_preset]
