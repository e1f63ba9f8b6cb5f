# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.object_references import in_scene
from ..blender.section import Advanced, Section, draw_settings, job_button, note, presets, settings_column
from ..carried import rest_bones
from ..core.settings.parameters import WRAP
from ..live.panel import result_row
from ..names import Op
from ..results.placement import holds_place, placement_refusal, replaced_by
from . import landmarks


class ARAPFIELDS_UL_landmarks(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index):
        row = layout.row(align=True)
        swatch = row.row()
        swatch.ui_units_x = 0.8
        swatch.prop(item, "colour", text="")
        if in_scene(item.rest) and in_scene(item.on_target):
            row.prop(item.rest, "name", text="", emboss=False)
        else:
            row.label(text="(deleted)", icon="ERROR")
        if item.left_out:
            row.prop(item, "left_out", text="", icon="ERROR", emboss=False)
        row.label(text=str(index + 1), translate=False)


class ARAPFIELDS_PT_wrap(Section, bpy.types.Panel):
    bl_label = "Wrap"
    bl_order = 4
    tasks = frozenset({"WRAP"})

    def draw_header_preset(self, context):
        presets(self.layout, "wrap")

    def fill(self, context, source, settings):
        layout, wrap = self.layout, settings.wrap
        draw_settings(layout, wrap, "onto")
        column = layout.column(align=True)
        column.operator(Op.SUGGEST_LANDMARKS, icon="LIGHT")
        column.operator(Op.CLICK_LANDMARKS, icon="PINNED")
        row = layout.row()
        row.template_list("ARAPFIELDS_UL_landmarks", "", wrap, "landmarks", wrap, "active_landmark", rows=3)
        column = row.column(align=True)
        column.operator(Op.REMOVE_LANDMARK, text="", icon="REMOVE").index = wrap.active_landmark
        column.separator()
        column.operator(Op.MIRROR_LANDMARKS, text="", icon="MOD_MIRROR")
        settings_column(layout, wrap, WRAP, advanced=False)
        if rest_bones.armatures_of(source):
            draw_settings(layout, wrap, "fit_rig")
        if not holds_place(source, wrap.onto):
            draw_settings(layout, wrap, "move_object")
        job_button(layout, Op.WRAP, "MOD_SHRINKWRAP")
        result_row(layout, source, "WRAP")
        draw_settings(layout, wrap, "transfer")
        if "GROUPS" in wrap.transfer:
            draw_settings(layout, wrap, "groups", "mix")
        layout.operator(Op.TRANSFER, icon="MOD_DATA_TRANSFER")
        layout.operator(Op.REFIT, icon="MOD_CLOTH")
        if rest_bones.fitted(source):
            layout.operator(Op.RESET_BONES, icon="BONE_DATA")
        note(layout, landmarks.refusal(source), placement_refusal(source), replaced_by(source, "WRAP"))


class ARAPFIELDS_PT_wrap_settings(Advanced, bpy.types.Panel):
    bl_label = "Wrap Settings"
    bl_order = 3
    tasks = frozenset({"WRAP"})

    def fill(self, context, source, settings):
        layout = self.layout
        job_button(layout, Op.WRAP_SHEET, "IMAGE_DATA")
        draw_settings(layout, settings.wrap, "frames")
        job_button(layout, Op.WRAP_SEQUENCE, "REC")
        settings_column(layout, settings.wrap, WRAP, advanced=True)


CLASSES = [ARAPFIELDS_UL_landmarks, ARAPFIELDS_PT_wrap, ARAPFIELDS_PT_wrap_settings]
