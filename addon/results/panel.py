# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.object_references import in_scene
from ..blender.section import Section
from ..names import Op


class ARAPFIELDS_PT_result(Section, bpy.types.Panel):
    bl_label = "Result"
    bl_idname = "ARAPFIELDS_PT_result"
    bl_order = 5

    def fill(self, context, source, settings):
        layout = self.layout
        layout.prop(settings, "resolution")
        layout.prop(settings, "normals")
        layout.operator(Op.EXTRACT, icon="OUTLINER_OB_SURFACE")
        for entry in settings.results:
            if in_scene(entry.item):
                row = layout.row()
                row.prop(entry.item, "name", text="", icon="OBJECT_DATA")
                row.prop(entry.item, "hide_viewport", text="", emboss=False)


CLASSES = [ARAPFIELDS_PT_result]
