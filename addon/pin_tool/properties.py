# SPDX-License-Identifier: GPL-3.0-or-later
"""scene.arapfields: settings of the pin tool, and stored poses."""

import bpy

from ..blender.property_definitions import choice, collection, flag, integer
from ..core.settings.choices import TASKS
from ..properties.choices import ARAPFIELDS_PG_pose


class ARAPFIELDS_PG_scene(bpy.types.PropertyGroup):
    poses: collection(ARAPFIELDS_PG_pose, "Poses", "Fields that are kept with the file")
    active_pose: integer("Active Pose", "Row chosen in the list of poses", options={"SKIP_SAVE"})
    task: choice(TASKS, "Task", "Which sections the panel shows")
    pin_radius: integer(
        "Radius",
        "Radius of the region that a new pin holds, on the screen",
        subtype="PIXEL",
        default=24,
        min=2,
        soft_max=200,
        max=2000,
    )
    pin_holds_turn: flag(
        "Hold Turn", "New pins hold how the surface is turned, too; without it a lifted hoof hangs naturally"
    )


CLASSES = [ARAPFIELDS_PG_scene]
