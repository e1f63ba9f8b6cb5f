# SPDX-License-Identifier: GPL-3.0-or-later
"""Performs the steps of docs/tutorial.md in Blender's window, and makes its pictures.

Pictures need ImageMagick's `import`, and xdotool for the mouse. A window of 1600 × 1000 is assumed.
"""

import math

import bpy
import numpy as np
import panel
import stage
from mathutils import Euler, Matrix, Vector
from support.blender import scenes

JAW = ((0.0, -0.35, -0.52), (0.50, 0.62, 0.46))
EAR = ((1.12, 0.32, 0.17), (0.30, 0.36, 0.40))
SHOWN = (0, 0, 1316, 905)  # the viewport with its sidebar


def look():
    """Sets the view to Suzanne from her left front, beside the sidebar."""
    with stage.override():
        view = bpy.context.area.spaces.active.region_3d
        view.view_perspective, view.view_distance = "PERSP", 6.0
        view.view_location = Vector((0.75, 0.0, 0.0))
        view.view_rotation = Euler((math.radians(76), 0, math.radians(24))).to_quaternion()


def picture(folder, name, sections):
    yield from panel.open_alone(sections)
    yield from stage.move(500, 940, pause=4.0)
    stage.picture(folder, f"tutorial-{name}", SHOWN)


def checks(figures, folder):
    stage.empty_file()
    with stage.override():
        bpy.ops.mesh.primitive_monkey_add()
        suzanne = bpy.context.object
        suzanne.modifiers.new("Subdivision", "SUBSURF").levels = 2
        bpy.ops.object.shade_smooth()
        jaw, ear = scenes.cube_empty(*JAW, "Empty"), scenes.cube_empty(*EAR, "Empty.001")
        bpy.context.view_layer.update()
        scenes.activate(jaw, ear, suzanne)
        bpy.ops.arapfields.add_handle()
        pivot = Matrix.Translation((0.8, 0, 0.2))
        turn = Matrix.Rotation(math.radians(-55), 4, "Y")
        ear.matrix_world = (
            Matrix.Translation((0.1, 0, 0.12)) @ pivot @ turn @ pivot.inverted() @ ear.matrix_world
        )
        scenes.activate(suzanne)
    figures["handles"] = len(suzanne.arapfields.handles)
    rest = scenes.world_points(suzanne)
    look()
    yield from stage.open_sidebar()
    yield from picture(folder, "handles", {"handles", "deform"})
    with stage.override():
        bpy.ops.arapfields.deform(output="WARP")
    deformed = scenes.world_points(suzanne)
    figures["deformed_by"] = round(float(np.abs(deformed - rest).max()), 3)
    yield from picture(folder, "deformed", {"source", "deform"})
    with stage.override():
        scenes.activate(suzanne)
        bpy.ops.arapfields.stylize(style="CUBE")
        figures["stylized_by"] = round(float(np.abs(scenes.world_points(suzanne) - deformed).max()), 3)
        for item in list(bpy.data.objects):
            item.hide_set(item != suzanne)
    yield from picture(folder, "style", {"source", "stylize"})
