# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..names import Op
from .section import Section


class ARAPFIELDS_UL_handles(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index):
        row = layout.row(align=True)
        if item.empty is None:
            row.label(text="(deleted)", icon="ERROR")
            return
        row.prop(item.empty, "name", text="", emboss=False, icon="CUBE" if item.kind == "CUBE" else "DOT")
        if item.kind == "CUBE" and item.inside >= 0:
            row.label(
                text=f"{item.inside:,}" if item.inside else "empty", icon="NONE" if item.inside else "ERROR"
            )


class ARAPFIELDS_PT_handles(Section, bpy.types.Panel):
    bl_label = "Handles"
    bl_idname = "ARAPFIELDS_PT_handles"
    bl_order = 2

    def fill(self, context, source, ours):
        layout = self.layout
        row = layout.row()
        row.template_list("ARAPFIELDS_UL_handles", "", ours, "handles", ours, "active_handle", rows=3)
        column = row.column(align=True)
        column.operator(Op.ADD_HANDLE, icon="ADD", text="")
        column.operator(Op.REMOVE_HANDLE, icon="REMOVE", text="")
        row = layout.row(align=True)
        row.operator(Op.SET_REST, icon="PINNED")
        row.operator(Op.RESET_HANDLE, icon="LOOP_BACK")


CLASSES = [ARAPFIELDS_UL_handles, ARAPFIELDS_PT_handles]
