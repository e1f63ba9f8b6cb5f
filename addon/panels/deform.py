# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..core.parameters import DEFORM
from ..names import Op
from .section import Section, job_button, live_buttons, presets, settings_column


class ARAPFIELDS_PT_deform(Section, bpy.types.Panel):
    bl_label = "Deform"
    bl_idname = "ARAPFIELDS_PT_deform"
    bl_order = 3

    def draw_header_preset(self, context):
        presets(self.layout, "deform")

    def fill(self, context, source, ours):
        layout = self.layout
        layout.prop(ours, "output")
        layout.prop(ours, "surface")
        layout.prop(ours, "target")
        settings_column(layout, ours.deform, DEFORM)
        job_button(layout, Op.DEFORM, "MOD_SIMPLEDEFORM")
        live_buttons(layout, source, "DEFORM")
        layout.operator(Op.BAKE, icon="REC")


CLASSES = [ARAPFIELDS_PT_deform]
