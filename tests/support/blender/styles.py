# SPDX-License-Identifier: GPL-3.0-or-later
"""A ball to stylize, and settings of quick solves."""

import bpy
from support.blender import scenes


def ball(name="Ball"):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4)
    bpy.context.object.name = name
    scenes.nudge(bpy.context.object.data)
    return bpy.context.object


SETTINGS = {"result": "NEW", "iterations": 60, "samples": 2000, "batch": 200, "width": 32, "layers": 2}
