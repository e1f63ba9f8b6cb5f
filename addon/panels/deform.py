# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..bridge import live
from ..core.parameters import DEFORM
from ..names import Op
from .section import Section, settings_column


class ARAPFIELDS_PT_deform(Section, bpy.types.Panel):
    bl_label = "Deform"
    bl_idname = "ARAPFIELDS_PT_deform"
    bl_order = 3

    def fill(self, context, source, ours):
        layout = self.layout
        layout.prop(ours, "output")
        layout.prop(ours, "surface")
        settings_column(layout, ours.deform, DEFORM)
        layout.operator(Op.DEFORM, icon="MOD_SIMPLEDEFORM")
        row = layout.row(align=True)
        row.operator(Op.LIVE, icon="PLAY", depress=live.is_live(source))
        row.operator(Op.BAKE, icon="REC")


CLASSES = [ARAPFIELDS_PT_deform]
