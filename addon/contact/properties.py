# SPDX-License-Identifier: GPL-3.0-or-later
"""object.arapfields.contact: what the surface does not pass."""

import bpy

from ..blender.property_definitions import flag, number, pointer


class ARAPFIELDS_PG_contact(bpy.types.PropertyGroup):
    use: flag(
        "Contact", "The surface does not pass obstacles, the ground or itself, wherever its handles pull it"
    )
    obstacle: pointer(
        bpy.types.Object, "Obstacle", "Mesh object that the surface stays outside of, as it is shown"
    )
    obstacles: pointer(
        bpy.types.Collection, "Obstacles", "Collection of whose visible meshes the surface stays outside"
    )
    margin: number(
        "Margin", "Distance that is kept from the obstacles", subtype="DISTANCE", min=0.0, soft_max=1.0
    )
    use_ground: flag("Level Ground", "The surface does not go below a height of the world")
    itself: flag(
        "Itself",
        "Parts of the shape do not pass each other. What touches or overlaps at rest is left as it is",
    )
    ground: number("Ground Height", "Height of the ground in the world", subtype="DISTANCE")


CLASSES = [ARAPFIELDS_PG_contact]
