# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.icons import icon
from ..blender.object_references import settings_of, source_of
from ..blender.section import (
    Advanced,
    Section,
    draw_settings,
    group_row,
    job_button,
    note,
    presets,
    settings_column,
)
from ..core.settings.choices import CUSTOM, STYLIZE
from ..live.panel import live_buttons, playback_progress, result_row
from ..names import Op
from ..properties.choices import STYLE_ITEMS
from ..results.placement import placement_refusal, replaced_by
from ..solver import style_settings
from . import ball

PLAIN = {"AXES": "EMPTY_AXIS", "OBJECT": "MESH_MONKEY"}  # icons of styles without an image


def picture_of(identifier, chosen):
    """A style's icon as keyword arguments of UILayout functions; for an object, a ball in its style."""
    number = icon(identifier)
    if identifier == "OBJECT" and chosen is not None:
        number = ball.icon(chosen)
    return {"icon_value": number} if number else {"icon": PLAIN.get(identifier, "NONE")}


class ARAPFIELDS_MT_styles(bpy.types.Menu):
    """The styles, with a picture of each"""

    bl_label = "Style"

    def draw(self, context):
        row = self.layout.row()
        source = source_of(context)
        chosen = settings_of(source).stylize.style_object if source else None
        columns, half = (row.column(), row.column()), (len(STYLE_ITEMS) + 1) // 2
        for number, (identifier, label, _) in enumerate(STYLE_ITEMS):
            picture = picture_of(identifier, chosen)
            columns[number // half].operator(Op.SET_STYLE, text=label, **picture).style = identifier


class ARAPFIELDS_PT_stylize(Section, bpy.types.Panel):
    bl_label = "Stylize"
    bl_order = 3
    tasks = frozenset({"STYLE"})

    def draw_header_preset(self, context):
        presets(self.layout, "stylize")

    def fill(self, context, source, settings):
        layout, style = self.layout, settings.stylize
        label = next(label for identifier, label, _ in STYLE_ITEMS if identifier == style.style)
        layout.menu("ARAPFIELDS_MT_styles", text=label, **picture_of(style.style, style.style_object))
        if style.style in CUSTOM:
            draw_settings(layout, style, "style_object")
        settings_column(layout, style, STYLIZE, advanced=False)
        reason = style_settings.refusal(source)
        live_buttons(layout, source, reason)
        job_button(layout, Op.STYLIZE, "MOD_EDGESPLIT")
        result_row(layout, source, "STYLIZE")
        playback_progress(layout, source, "STYLIZE")
        note(layout, reason, placement_refusal(source), replaced_by(source, "STYLIZE"))


class ARAPFIELDS_PT_stylize_settings(Advanced, bpy.types.Panel):
    bl_label = "Stylize Settings"
    bl_order = 2
    tasks = frozenset({"STYLE"})

    def fill(self, context, source, settings):
        layout, style = self.layout, settings.stylize
        if style.style not in CUSTOM:
            draw_settings(layout, style, "frame")
            if style.frame == "EMPTY":
                draw_settings(layout, style, "frame_object")
        group_row(layout, style, "region", source)
        draw_settings(layout, style, "region_material", "use_handles")
        settings_column(layout, style, STYLIZE, advanced=True)


CLASSES = [ARAPFIELDS_MT_styles, ARAPFIELDS_PT_stylize, ARAPFIELDS_PT_stylize_settings]
