# SPDX-License-Identifier: GPL-3.0-or-later
"""object.arapfields.contact: obstacles, ground and self-contact."""

import bpy

from ..blender.object_references import settings_of
from ..blender.property_definitions import collection, flag, integer, number, pointer

# object.arapfields.contact: obstacles, ground and self-contact.


class ARAPFIELDS_PG_obstacle(bpy.types.PropertyGroup):
    # `name`, which every PropertyGroup has, keeps the object's name for messages after its deletion
    item: pointer(
        bpy.types.Object,
        "Object",
        "Mesh object that the surface stays outside of, as it is shown",
        poll=lambda _, item: item.type == "MESH",
    )
    group: pointer(
        bpy.types.Collection,
        "Collection",
        "In the object's place, a collection of whose visible meshes the surface stays outside",
    )
    margin: number("Margin", "Distance that is kept from it", subtype="DISTANCE", min=0.0, soft_max=1.0)


class ARAPFIELDS_PG_contact(bpy.types.PropertyGroup):
    use: flag(
        "Contact", "The surface does not pass obstacles, the ground or itself, wherever its handles pull it"
    )
    obstacle_list: collection(ARAPFIELDS_PG_obstacle, "Obstacles", "What is in the way")
    active_obstacle: integer("Active Obstacle", "Row chosen in the list of obstacles")
    use_ground: flag("Level Ground", "The surface does not go below a height of the world")
    ground: number("Ground Height", "Height of the ground in the world", subtype="DISTANCE")
    itself: flag(
        "Itself",
        "Parts of the shape do not pass each other. What touches or overlaps at rest is left as it is",
    )


# Adds entries to a source's list of obstacles.


def add(source, item, margin=0.0):
    """Adds an object, or with None an empty row, to a source's list; returns the entry."""
    group = settings_of(source).contact
    entry = group.obstacle_list.add()
    group.active_obstacle = len(group.obstacle_list) - 1
    entry.margin = margin
    if item is not None:
        entry.name, entry.item = item.name, item
    return entry


CLASSES = [
    ARAPFIELDS_PG_obstacle,
    ARAPFIELDS_PG_contact,
]
