# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact of a source: its panel and operators."""

import bpy

from ..blender.language import translated
from ..blender.object_references import in_scene, owner_of, settings_of, source_of
from ..blender.section import Section, draw_settings, note, switched, wrapped
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError
from ..names import Op
from ..solver import contact
from .properties import add

# The list of obstacles.


class ObstacleOperator(SourceOperator):
    """Mixin: works on the list of obstacles of the panel's source."""

    bl_options = {"REGISTER", "UNDO"}
    guide = "motion"


class ARAPFIELDS_OT_add_obstacle(ObstacleOperator, bpy.types.Operator):
    """Add the other selected meshes to what is in the way; without any, a row to choose something in"""

    bl_label = "Add Obstacles"

    def change(self, context, source):
        group = settings_of(source).contact
        others = [item for item in context.selected_objects if item != source and owner_of(item) != source]
        if others and all(item.type != "MESH" for item in others):
            raise UserError("{name} is no mesh; a mesh object is needed as an obstacle", others[0])
        known = {entry.item for entry in [*group.obstacle_list, *settings_of(source).carried]}
        for item in others or [None]:
            if item is None or (item.type == "MESH" and item not in known):
                add(source, item)
        group.use = True
        return translated("Obstacles of {name}: {count}", name=source.name, count=len(group.obstacle_list))


class ARAPFIELDS_OT_remove_obstacle(ObstacleOperator, bpy.types.Operator):
    """Take the chosen obstacle off the list"""

    bl_label = "Remove Obstacle"

    @classmethod
    def refuses(cls, source):
        if not settings_of(source).contact.obstacle_list:
            return UserError("{name} has no obstacles", source)
        return super().refuses(source)

    def change(self, context, source):
        group = settings_of(source).contact
        last = len(group.obstacle_list) - 1
        group.obstacle_list.remove(min(max(group.active_obstacle, 0), last))
        group.active_obstacle = max(0, min(group.active_obstacle, last - 1))


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


class ARAPFIELDS_PT_contact(Section, bpy.types.Panel):
    bl_label = "Contact"
    bl_order = 8
    tasks = frozenset({"POSE", "STYLE"})
    bl_options = {"DEFAULT_CLOSED"}

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


CLASSES = [
    ARAPFIELDS_OT_add_obstacle,
    ARAPFIELDS_OT_remove_obstacle,
    ARAPFIELDS_UL_obstacles,
    ARAPFIELDS_PT_contact,
]
