# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.section import Section
from ..names import Op


class ARAPFIELDS_UL_poses(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index):
        layout.prop(item, "name", text="", emboss=False, icon="ARMATURE_DATA")


class ARAPFIELDS_PT_poses(Section, bpy.types.Panel):
    bl_label = "Poses"
    bl_order = 9
    tasks = frozenset({"RIG"})
    bl_options = {"DEFAULT_CLOSED"}

    def fill(self, context, source, settings):
        group, layout = context.scene.arapfields, self.layout
        row = layout.row()
        row.template_list("ARAPFIELDS_UL_poses", "", group, "poses", group, "active_pose", rows=3)
        column = row.column(align=True)
        column.operator(Op.SAVE_POSE, icon="ADD", text="")
        column.operator(Op.REMOVE_POSE, icon="REMOVE", text="")
        column.separator()
        column.operator(Op.IMPORT_POSE, icon="IMPORT", text="")
        column.operator(Op.EXPORT_POSE, icon="EXPORT", text="")
        layout.operator(Op.APPLY_POSE, icon="CHECKMARK")


CLASSES = [ARAPFIELDS_UL_poses, ARAPFIELDS_PT_poses]
