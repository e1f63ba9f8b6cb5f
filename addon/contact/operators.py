# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of obstacles."""

import bpy

from ..blender.language import translated
from ..blender.object_references import owner_of, settings_of
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError
from .properties import add


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


CLASSES = [ARAPFIELDS_OT_add_obstacle, ARAPFIELDS_OT_remove_obstacle]
