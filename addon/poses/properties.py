# SPDX-License-Identifier: GPL-3.0-or-later
"""A stored pose of a scene."""

import bpy

from ..blender.property_definitions import text


class ARAPFIELDS_PG_pose(bpy.types.PropertyGroup):
    data: text("Field", "The field, with samples of the shape that it was solved on")


CLASSES = [ARAPFIELDS_PG_pose]
