# SPDX-License-Identifier: GPL-3.0-or-later
"""The tutorial of docs/tutorial.md, step by step in a real Blender's window; makes its pictures.

blender --factory-startup --python tests/gui/tutorial.py -- OUTPUT_FOLDER
Pictures need ImageMagick's `import`. A window of 1600 × 1000 is assumed.
"""

import contextlib
import math
import subprocess
import sys
import traceback
from pathlib import Path

import bpy
from mathutils import Euler, Matrix, Vector

ROOT = Path(__file__).resolve().parents[2]
OUTPUT = Path(sys.argv[sys.argv.index("--") + 1])
sys.path[:0] = [str(ROOT)]

import addon  # noqa: E402
import addon.panels as panels  # noqa: E402

JAW = ((0.0, -0.35, -0.52), (0.50, 0.62, 0.46))
STEPS = 60  # enough for a picture
TAB = (1299, 340)  # where the sidebar's last tab lies
EAR = ((1.12, 0.32, 0.17), (0.30, 0.36, 0.40))


def override():
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    region = next(r for r in area.regions if r.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def show_sidebar():
    with override():
        bpy.context.area.spaces.active.show_region_ui = True
        for region in bpy.context.area.regions:
            if region.type == "UI":
                with contextlib.suppress(AttributeError):  # read-only in some versions
                    region.active_panel_category = "ARAP Fields"


def open_alone(names):
    """These sections of the panel are open: registered anew, since a panel's state cannot be set."""
    for section in panels.SECTIONS:
        cls = next(c for c in section.CLASSES if issubclass(c, bpy.types.Panel))
        bpy.utils.unregister_class(cls)
        options = set(getattr(cls, "bl_options", set())) - {"DEFAULT_CLOSED"}
        closed = cls.__name__.rsplit("_", 1)[1] not in names
        cls.bl_options = options | ({"DEFAULT_CLOSED"} if closed else set())
        bpy.utils.register_class(cls)


def look():
    """The view shows Suzanne from her left front, beside the sidebar."""
    with override():
        view = bpy.context.area.spaces.active.region_3d
        view.view_perspective, view.view_distance = "PERSP", 6.0
        view.view_location = Vector((0.75, 0.0, 0.0))
        view.view_rotation = Euler((math.radians(76), 0, math.radians(24))).to_quaternion()


def picture(name):
    subprocess.run(["import", "-window", "root", str(OUTPUT / f"tutorial-{name}.png")], check=False)


def activate(*items):
    bpy.ops.object.select_all(action="DESELECT")
    for item in items:
        item.select_set(True)
    bpy.context.view_layer.objects.active = items[-1]


def empty(name, centre, half):
    bpy.ops.object.empty_add(type="CUBE", radius=1.0, location=centre)
    item = bpy.context.object
    item.name, item.scale = name, half
    return item


def steps():
    with override():
        for item in list(bpy.data.objects):
            bpy.data.objects.remove(item)
        bpy.ops.mesh.primitive_monkey_add()
        suzanne = bpy.context.object
        suzanne.modifiers.new("Subdivision", "SUBSURF").levels = 2
        bpy.ops.object.shade_smooth()
        jaw, ear = empty("Jaw", *JAW), empty("Ear", *EAR)
        activate(jaw, ear, suzanne)
        bpy.ops.arapfields.add_handle()
        pivot = Matrix.Translation((0.8, 0, 0.2))
        turn = Matrix.Rotation(math.radians(-55), 4, "Y")
        ear.matrix_world = (
            Matrix.Translation((0.1, 0, 0.12)) @ pivot @ turn @ pivot.inverted() @ ear.matrix_world
        )
        activate(suzanne)
    look()
    show_sidebar()
    yield 4.0
    subprocess.run(["xdotool", "mousemove", *map(str, TAB), "click", "1"], check=False)
    yield 2.0
    open_alone({"source", "handles", "deform"})
    show_sidebar()
    yield 4.0
    picture("handles")
    with override():
        bpy.ops.arapfields.deform(output="WARP", iterations=STEPS)
        suzanne.hide_set(True)
    open_alone({"source", "deform", "result", "status"})
    show_sidebar()
    yield 4.0
    picture("deformed")
    with override():
        suzanne.hide_set(False)
        activate(suzanne)
        bpy.ops.arapfields.stylize(style="CUBE", strength=0.8, iterations=STEPS)
        for item in bpy.data.objects:
            item.hide_set(item.name != "Suzanne_stylized")
    open_alone({"source", "stylize"})
    show_sidebar()
    yield 4.0
    picture("style")


def drive(sequence):
    try:
        return next(sequence)
    except StopIteration:
        print("tutorial done")
    except Exception:
        traceback.print_exc()
    bpy.ops.wm.quit_blender()
    return None


def main():
    bpy.context.preferences.view.show_splash = False
    OUTPUT.mkdir(parents=True, exist_ok=True)
    addon.register()
    sequence = steps()
    bpy.app.timers.register(lambda: drive(sequence), first_interval=1.0, persistent=True)


main()
