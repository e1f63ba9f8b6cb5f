# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.language import translated
from ..blender.object_references import in_scene
from ..blender.section import Section, characters, note, wrapped
from ..names import Op
from . import refusals

ICONS = {"MESH": "OUTLINER_OB_MESH", "CURVE": "OUTLINER_OB_CURVE", "SURFACE": "OUTLINER_OB_SURFACE"}
ICONS |= {
    "CURVES": "OUTLINER_OB_CURVES",
    "POINTCLOUD": "OUTLINER_OB_POINTCLOUD",
    "EMPTY": "OUTLINER_OB_EMPTY",
}
ICONS |= {"LATTICE": "OUTLINER_OB_LATTICE", "ARMATURE": "OUTLINER_OB_ARMATURE"}
ICONS |= {"GREASEPENCIL": "OUTLINER_OB_GREASEPENCIL"}


SHARE, LEAST = 0.5, 8  # of the sidebar's characters: room for a name; and at least so many


class ARAPFIELDS_UL_carried(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index):
        row = layout.row(align=True)
        if not in_scene(item.item):
            row.label(text="(deleted)", icon="ERROR")
            return
        icon, room = ICONS.get(item.item.type, "OBJECT_DATA"), max(LEAST, int(SHARE * characters()))
        if len(item.item.name) > room:  # the ends of names tell left from right
            row.label(text="…" + item.item.name[1 - room :], icon=icon, translate=False)
        else:
            row.prop(item.item, "name", text="", emboss=False, icon=icon)
        row.prop(item, "way", text="", emboss=False)
        if refusals.of_entry(data.id_data, item) is not None:
            row.label(text="", icon="ERROR")


class ARAPFIELDS_PT_carried(Section, bpy.types.Panel):
    bl_label = "Carried Objects"
    bl_order = 6
    tasks = frozenset({"POSE", "STYLE", "WRAP"})
    bl_options = {"DEFAULT_CLOSED"}

    def fill(self, context, source, settings):
        layout = self.layout
        row = layout.row()
        row.template_list(
            "ARAPFIELDS_UL_carried", "", settings, "carried", settings, "active_carried", rows=3
        )
        column = row.column(align=True)
        column.operator(Op.CARRY, icon="ADD", text="")
        column.operator(Op.RELEASE, icon="REMOVE", text="")
        if not settings.carried:
            hint = translated(
                "Select clothes, eyes or hair, then this object, and press +: they move with it"
            )
            wrapped(layout, hint, icon="INFO")
        for entry in settings.carried:
            note(layout, refusals.of_entry(source, entry))


CLASSES = [ARAPFIELDS_UL_carried, ARAPFIELDS_PT_carried]
