# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.section import Advanced, note
from ..names import Op
from . import painted


class ARAPFIELDS_PT_stiffness(Advanced, bpy.types.Panel):
    bl_label = "Painted Stiffness"
    bl_order = 2

    def fill(self, context, source, settings):
        layout, group = self.layout, settings.stiffness
        layout.operator_menu_enum(Op.STIFFNESS_PRESET, "material", icon="MATERIAL")
        layout.prop_search(group, "group", source, "vertex_groups")
        row = layout.row()
        row.enabled = bool(group.group)
        row.prop(group, "times")
        layout.prop_search(group, "bend_group", source, "vertex_groups")
        row = layout.row()
        row.enabled = bool(group.bend_group)
        row.prop(group, "bend_times")
        layout.prop_search(group, "mask", source, "vertex_groups")
        note(layout, painted.refusal(source))


CLASSES = [ARAPFIELDS_PT_stiffness]
