# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.section import Section, job_button, presets, settings_column
from ..core.settings.parameters import DEFORM
from ..live.panel import live_buttons
from ..names import Op


class ARAPFIELDS_PT_deform(Section, bpy.types.Panel):
    bl_label = "Deform"
    bl_idname = "ARAPFIELDS_PT_deform"
    bl_order = 3

    def draw_header_preset(self, context):
        presets(self.layout, "deform")

    def fill(self, context, source, settings):
        layout = self.layout
        layout.prop(settings, "output")
        layout.prop(settings, "target")
        settings_column(layout, settings.deform, DEFORM)
        job_button(layout, Op.DEFORM, "MOD_SIMPLEDEFORM")
        live_buttons(layout, source, "DEFORM")
        layout.operator(Op.BAKE, icon="REC")


CLASSES = [ARAPFIELDS_PT_deform]
