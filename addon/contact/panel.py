# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.language import translated
from ..blender.object_references import in_scene, settings_of, source_of
from ..blender.section import OfOthers, draw_settings, note, switched, wrapped
from ..names import Op
from ..solver import contact


class ARAPFIELDS_UL_obstacles(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index):
        row = layout.row(align=True)
        if item.group is not None:
            row.prop(item.group, "name", text="", emboss=False, icon="OUTLINER_COLLECTION")
        elif in_scene(item.item):
            shown = "OUTLINER_OB_MESH" if contact.is_shown(item.item) else "HIDE_ON"
            row.prop(item.item, "name", text="", emboss=False, icon=shown)
        else:
            row.label(text="(deleted)" if item.name else "(choose below)", icon="ERROR")
        margin = row.row()
        margin.ui_units_x = 4.0
        margin.prop(item, "margin", text="", emboss=False)


class ARAPFIELDS_PT_contact(OfOthers, bpy.types.Panel):
    bl_label = "Contact"
    bl_order = 1
    tasks = frozenset({"POSE", "STYLE"})

    def draw_header(self, context):
        self.layout.prop(settings_of(source_of(context)).contact, "use", text="")

    def fill(self, context, source, settings):
        group, layout = settings.contact, self.layout
        row = layout.row()
        row.template_list(
            "ARAPFIELDS_UL_obstacles", "", group, "obstacle_list", group, "active_obstacle", rows=3
        )
        buttons = row.column(align=True)
        buttons.operator(Op.ADD_OBSTACLE, icon="ADD", text="")
        buttons.operator(Op.REMOVE_OBSTACLE, icon="REMOVE", text="")
        layout = layout.column()
        if not group.obstacle_list:
            hint = translated("Select what is in the way, then this object, and press +")
            wrapped(layout, hint, icon="INFO")
        layout.enabled = group.use
        if 0 <= group.active_obstacle < len(group.obstacle_list):
            entry = group.obstacle_list[group.active_obstacle]
            names = ("item", "group") if entry.group is None else ("group",)
            draw_settings(layout, entry, *names, "margin")
            note(layout, contact.entry_refusal(source, entry))
        switched(layout, group, "use_ground", "ground")
        draw_settings(layout, group, "itself")
        note(layout, contact.refusal(source))


CLASSES = [ARAPFIELDS_UL_obstacles, ARAPFIELDS_PT_contact]
