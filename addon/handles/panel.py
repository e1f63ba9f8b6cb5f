# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import icons
from ..blender.language import translated
from ..blender.object_references import source_of
from ..blender.section import Section, draw_settings, group_row, note, switched, wrapped
from ..names import Op
from . import empties, movers

ICONS = {"CUBE": "CUBE", "POINT": "DOT", "GROUP": "GROUP_VERTEX", "PIN": "PINNED", "BONE": "BONE_DATA"}


def anchor_icon(entry):
    """The icon of a handle or an anchor, as keyword arguments of UILayout functions."""
    number = icons.icon("ANCHOR") if entry.anchor else 0
    return {"icon_value": number} if number else {"icon": "PINNED" if entry.anchor else "LAYER_USED"}


class ARAPFIELDS_UL_handles(bpy.types.UIList):
    def filter_items(self, context, data, propname):
        entries = getattr(data, propname)
        return [0 if movers.is_copied(entry) else self.bitflag_filter_item for entry in entries], []

    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index):
        row = layout.row(align=True)
        if not movers.has_mover(item):
            row.label(text="(deleted)", icon="ERROR")
            return
        swatch = row.row()
        swatch.ui_units_x = 0.8
        swatch.prop(item, "colour", text="")
        named = item.rig.data.bones[movers.bone_of(item)] if item.kind == "BONE" else item.empty
        row.prop(named, "name", text="", emboss=False, icon=ICONS[item.kind])
        if item.kind in empties.PINS:
            row.prop(item, "anchor", text="", emboss=False, **anchor_icon(item))
        if item.inside >= 0:
            text, held = f"{item.inside:,}" if item.inside else translated("empty"), row.row()
            held.ui_units_x = 0.4 * len(text) + (0.6 if item.inside else 1.6)  # the name has the rest
            held.label(text=text, icon="NONE" if item.inside else "ERROR", translate=False)


class ARAPFIELDS_MT_add_handle(bpy.types.Menu):
    """Ways to make a handle"""

    bl_label = "Add Handle"

    def draw(self, context):
        layout = self.layout
        for kind, place, text, icon in (
            ("CUBE", "AUTO", "From Selected Empties", "EMPTY_DATA"),
            ("CUBE", "CURSOR", "At 3D Cursor", "PIVOT_CURSOR"),
            ("CUBE", "SELECTION", "Around Selected Vertices", "VERTEXSEL"),
            ("PIN", "CURSOR", "Pin at 3D Cursor", "PINNED"),
            ("POINT", "CURSOR", "Point Pin at 3D Cursor", "DOT"),
            ("GROUP", "AUTO", "From Active Vertex Group", "GROUP_VERTEX"),
        ):
            row = layout.row()
            row.enabled = empties.can_place(source_of(context), kind, place)
            operator = row.operator(Op.ADD_HANDLE, text=text, icon=icon)
            operator.kind, operator.place = kind, place
        layout.operator(Op.ADD_BONES, icon="ARMATURE_DATA")


class ARAPFIELDS_MT_more_handle(bpy.types.Menu):
    """What else can be done with handles"""

    bl_label = "More"

    def draw(self, context):
        layout = self.layout
        layout.operator_menu_enum(Op.MIRROR_HANDLE, "axis", icon="MOD_MIRROR")
        layout.operator(Op.SET_REST, text="Set Rest Pose of All", icon="PINNED").all = True
        layout.operator(Op.RESET_HANDLE, text="Move All Back to Rest", icon="LOOP_BACK").all = True
        layout.separator()
        layout.operator(Op.REMOVE_HANDLE, text="Delete with Empties", icon="TRASH").delete = True


class ARAPFIELDS_PT_handles(Section, bpy.types.Panel):
    bl_label = "Handles"
    bl_order = 1
    tasks = frozenset({"POSE"})

    def fill(self, context, source, settings):
        layout = self.layout
        row = layout.row()
        row.template_list("ARAPFIELDS_UL_handles", "", settings, "handles", settings, "active_handle", rows=3)
        column = row.column(align=True)
        column.menu("ARAPFIELDS_MT_add_handle", icon="ADD", text="")
        column.operator(Op.REMOVE_HANDLE, icon="REMOVE", text="")
        column.separator()
        column.menu("ARAPFIELDS_MT_more_handle", icon="DOWNARROW_HLT", text="")
        if not empties.listed(source):
            hint = translated("Drag the shape with the pin tool, or press + for a pin or a box")
            wrapped(layout, hint, icon="INFO")
            return
        if settings.keep_rest:  # of an older file; Locality does without
            switched(layout, settings, "keep_rest", "keep_beyond")
        layout.operator(Op.RESET_HANDLE, icon="LOOP_BACK")
        layout.operator(Op.SET_REST, icon="PINNED")
        entry = empties.chosen_entry(source)
        if entry is not None:
            draw_settings(layout, entry, "reach")
            if entry.kind in empties.PINS:
                draw_settings(layout, entry, "hold_turn")
            if entry.kind != "BONE":
                draw_settings(layout, entry, "in_world")
            if entry.kind != "POINT":
                draw_settings(layout, entry, "allow_scale")
            if entry.kind in ("GROUP", "BONE"):
                group_row(layout, entry, "group", source)
            if entry.group:
                draw_settings(layout, entry, "hold_from")
            note(layout, empties.ignored_scale(source))


CLASSES = [
    ARAPFIELDS_UL_handles,
    ARAPFIELDS_MT_add_handle,
    ARAPFIELDS_MT_more_handle,
    ARAPFIELDS_PT_handles,
]
