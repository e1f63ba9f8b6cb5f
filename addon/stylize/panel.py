# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.icons import icon
from ..blender.section import Section, job_button, presets, settings_column
from ..core.settings.styles import CUSTOM, STYLIZE
from ..live.panel import live_buttons
from ..names import Op
from ..properties.settings import STYLE_ITEMS


class ARAPFIELDS_MT_styles(bpy.types.Menu):
    """The styles, with a picture of each"""

    bl_label = "Style"

    def draw(self, context):
        row = self.layout.row()
        columns, half = (row.column(), row.column()), (len(STYLE_ITEMS) + 1) // 2
        for number, (identifier, label, _) in enumerate(STYLE_ITEMS):
            plain = "EMPTY_AXIS" if identifier in CUSTOM else "NONE"
            picture = {"icon_value": icon(identifier)} if icon(identifier) else {"icon": plain}
            columns[number // half].operator(Op.SET_STYLE, text=label, **picture).style = identifier


class ARAPFIELDS_PT_stylize(Section, bpy.types.Panel):
    bl_label = "Stylize"
    bl_idname = "ARAPFIELDS_PT_stylize"
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context):
        presets(self.layout, "stylize")

    def fill(self, context, source, settings):
        layout, style = self.layout, settings.stylize
        label = next(label for identifier, label, _ in STYLE_ITEMS if identifier == style.style)
        if icon(style.style):
            row = layout.row()
            row.alignment = "CENTER"
            row.template_icon(icon(style.style), scale=4.0)
        layout.menu("ARAPFIELDS_MT_styles", text=label)
        if style.style in CUSTOM:
            layout.prop(style, "style_object")
        else:
            layout.prop(style, "frame")
            if style.frame == "EMPTY":
                layout.prop(style, "frame_object")
        layout.prop_search(style, "region", source, "vertex_groups")
        layout.prop(style, "region_material")
        layout.prop(style, "use_handles")
        settings_column(layout, style, STYLIZE)
        layout.prop(settings, "output")
        layout.prop(settings, "target")
        job_button(layout, Op.STYLIZE, "MOD_EDGESPLIT")
        live_buttons(layout, source, "STYLIZE")


CLASSES = [ARAPFIELDS_MT_styles, ARAPFIELDS_PT_stylize]
