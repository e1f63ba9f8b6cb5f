# SPDX-License-Identifier: GPL-3.0-or-later
"""Painted stiffness: a source's settings, presets, the panel."""

import bpy

from ..blender import vertex_groups
from ..blender.object_references import settings_of
from ..blender.property_definitions import choice
from ..blender.section import Advanced, group_row, note
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError
from ..names import Op
from . import painted
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


class ARAPFIELDS_PT_stiffness(Advanced, bpy.types.Panel):
    bl_label = "Painted Stiffness"
    bl_order = 4
    tasks = frozenset({"POSE"})

    def fill(self, context, source, settings):
        layout, group = self.layout, settings.stiffness
        layout.operator_menu_enum(Op.STIFFNESS_PRESET, "material", icon="PRESET")
        group_row(layout, group, "group", source, "times")
        group_row(layout, group, "bend_group", source, "bend_times")
        group_row(layout, group, "mask", source)
        note(layout, painted.refusal(source))


CLASSES = [
    ARAPFIELDS_OT_stiffness_preset,
    ARAPFIELDS_PT_stiffness,
]
