# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..core.styles import STYLIZE
from ..names import Op
from .section import Section, live_buttons, settings_column


class ARAPFIELDS_PT_stylize(Section, bpy.types.Panel):
    bl_label = "Stylize"
    bl_idname = "ARAPFIELDS_PT_stylize"
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}

    def fill(self, context, source, ours):
        layout = self.layout
        layout.prop(ours.stylize, "style")
        layout.prop(ours.stylize, "frame")
        if ours.stylize.frame == "EMPTY":
            layout.prop(ours.stylize, "frame_object")
        layout.prop_search(ours.stylize, "region", source, "vertex_groups")
        layout.prop(ours.stylize, "use_handles")
        settings_column(layout, ours.stylize, STYLIZE)
        layout.operator(Op.STYLIZE, icon="MOD_EDGESPLIT")
        live_buttons(layout, source, "STYLIZE")


CLASSES = [ARAPFIELDS_PT_stylize]
