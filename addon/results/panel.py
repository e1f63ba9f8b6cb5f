# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import modifier_stack
from ..blender.object_references import in_scene, results_of
from ..blender.section import Advanced, draw_settings, modifier_row
from ..names import Op


class ARAPFIELDS_PT_result(Advanced, bpy.types.Panel):
    bl_label = "Result"
    bl_order = 5

    def fill(self, context, source, settings):
        layout = self.layout
        draw_settings(layout, settings, "output", "result", "resolution", "refine_thin", "normals")
        layout.operator(Op.EXTRACT, icon="OUTLINER_OB_SURFACE")
        layout.operator(Op.FIELD_NODES, icon="GEOMETRY_NODES")
        modifier = modifier_stack.top(source)
        if modifier is not None:
            modifier_row(layout, modifier, "GEOMETRY_NODES", Op.REMOVE_FIELD)
            layout.operator(Op.APPLY_KEY, icon="SHAPEKEY_DATA")
        for entry in results_of(source):
            if in_scene(entry.item):
                row = layout.row()
                row.prop(entry.item, "name", text="", icon="OBJECT_DATA")
                row.prop(entry.item, "hide_viewport", text="", emboss=False)


CLASSES = [ARAPFIELDS_PT_result]
