# SPDX-License-Identifier: GPL-3.0-or-later
"""The tutorial of docs/tutorial.md, step by step in a real Blender's window; makes its pictures.

blender --factory-startup --python tests/gui/tutorial.py -- OUTPUT_FOLDER
Pictures need ImageMagick's `import`, and xdotool for the mouse. A window of 1600 × 1000 is assumed.
"""

import math
import sys
from pathlib import Path

import bpy
from mathutils import Euler, Matrix, Vector

ROOT = Path(__file__).resolve().parents[2]
OUTPUT = Path(sys.argv[sys.argv.index("--") + 1])
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "tests/gui")]

import panel  # noqa: E402
import stage  # noqa: E402
from support.blender import scenes  # noqa: E402

JAW = ((0.0, -0.35, -0.52), (0.50, 0.62, 0.46))
EAR = ((1.12, 0.32, 0.17), (0.30, 0.36, 0.40))
SHOWN = (0, 0, 1316, 905)  # the viewport with its sidebar


def look():
    """The view shows Suzanne from her left front, beside the sidebar."""
    with stage.override():
        view = bpy.context.area.spaces.active.region_3d
        view.view_perspective, view.view_distance = "PERSP", 6.0
        view.view_location = Vector((0.75, 0.0, 0.0))
        view.view_rotation = Euler((math.radians(76), 0, math.radians(24))).to_quaternion()


def picture(name, sections):
    yield from panel.open_alone(sections)
    stage.tool("mousemove", 500, 940)
    yield 4.0
    stage.picture(OUTPUT, f"tutorial-{name}", SHOWN)


def steps():
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
    look()
    yield from stage.open_sidebar()
    yield from picture("handles", {"source", "handles", "deform"})
    with stage.override():
        bpy.ops.arapfields.deform(output="WARP")
    yield from picture("deformed", {"source", "deform"})
    with stage.override():
        scenes.activate(suzanne)
        bpy.ops.arapfields.stylize(style="CUBE")
        for item in bpy.data.objects:
            item.hide_set(item != suzanne)
    yield from picture("style", {"source", "stylize"})


def ended(error):
    print(error or "tutorial done", flush=True)


stage.start(steps, ended, OUTPUT)
