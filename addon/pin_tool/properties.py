# SPDX-License-Identifier: GPL-3.0-or-later
"""scene.arapfields: settings of the pin tool."""

import bpy


class ARAPFIELDS_PG_scene(bpy.types.PropertyGroup):
    pin_radius: bpy.props.IntProperty(
        name="Radius",
        description="Radius of the region that a new pin holds, on the screen",
        subtype="PIXEL",
        default=24,
        min=2,
        soft_max=200,
        max=2000,
    )


CLASSES = [ARAPFIELDS_PG_scene]
