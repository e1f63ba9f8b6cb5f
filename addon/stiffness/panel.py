# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.section import Advanced, group_row, note
from ..names import Op
from . import painted


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


CLASSES = [ARAPFIELDS_PT_stiffness]
