# SPDX-License-Identifier: GPL-3.0-or-later
"""The tutorial walked by mouse and keys alone, and what a newcomer finds us by; a picture after each step.

blender --python tests/gui/walk.py -- OUTPUT_FOLDER
For the first words that the extension says, it is installed; else the add-on of this clone is switched on. A
window of 1600 × 1000 is assumed.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
OUTPUT = Path(sys.argv[sys.argv.index("--") + 1])
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "tests/gui")]

import panel  # noqa: E402
import stage  # noqa: E402
import use  # noqa: E402
from mouse import until  # noqa: E402
from support.blender import scenes  # noqa: E402

FOUND = {}
F3, MINUS = "69", "20"  # their codes: by their names the X server may press Alt too
MIDDLE = (560, 520)  # of the 3D view
JAW = ((0.0, -0.35, -0.52), (0.50, 0.62, 0.46))
EAR = ((1.12, 0.32, 0.17), (0.30, 0.36, 0.40))
# In the sidebar with one section open alone: the list's + and its rows, Deform and Stylize.
PLUS, FROM_EMPTIES, SECOND_ROW = (1261, 159), (1340, 180), (1130, 181)
DEFORM, STYLIZE = (1140, 223), (1140, 313)
FIT, FIT_SURFACE = (1252, 25), (1130, 80)  # below the header of Implicit Surface, within Advanced


def keys(*names, pause=0.4):
    for name in names:
        stage.tool("key", name)
        yield pause


def words(text, pause=1.0):
    stage.tool("type", "--delay", 60, text)
    yield pause


def number(value):
    """Types a number into Blender's transform and confirms it."""
    yield from words(f"{abs(value):g}", 0.5)
    if value < 0:
        yield from keys(MINUS, pause=0.3)
    yield from keys("Return", pause=0.6)


def click(x, y, button=1, pause=1.2):
    stage.tool("mousemove", x - 3, y)
    yield 0.3
    stage.tool("mousemove", x, y)
    yield 0.3
    stage.tool("click", button)
    yield pause


def over_the_view():
    stage.tool("mousemove", *MIDDLE)
    yield 0.5


def searched(text):
    """F3 and some words: Return then does what the first line found does."""
    yield from over_the_view()
    yield from keys(F3, pause=2.0)
    yield from words(text, 2.0)


def shot(name):
    yield 0.6
    stage.picture(OUTPUT, f"walk-{name}")


def found_by_name():
    yield from shot("welcome")
    yield from keys("Escape")
    for text in ("arap", "pin", "deform", "stylize"):
        yield from searched(text)
        yield from shot(f"f3-{text}")
        yield from keys("Escape", "Escape")
    with stage.override():
        bpy.ops.wm.call_menu(name="VIEW3D_MT_empty_add")
    yield from shot("empties")
    yield from keys("Escape", pause=1.0)


def monkey():
    for item in list(bpy.data.objects):  # the tutorial begins with Suzanne alone
        item.select_set(item.type == "MESH")
    yield from over_the_view()
    yield from keys("x", pause=1.0)
    yield from keys("Return", pause=1.0)
    yield from searched("add mesh monkey")
    yield from keys("Return", pause=2.0)
    FOUND["suzanne"] = [item.name for item in bpy.data.objects if item.type == "MESH"]
    yield from over_the_view()
    yield from keys("ctrl+2", pause=1.5)
    yield from searched("shade smooth")
    yield from keys("Return", pause=2.0)
    yield from over_the_view()
    yield from keys("n", pause=1.5)
    stage.tool("mousemove", *stage.TAB, "click", 1)
    yield 1.5
    FOUND["modifiers"] = [m.type for m in bpy.context.object.modifiers]
    yield from shot("suzanne")


def cube_empty(location, scale, picture=""):
    """Add › Empty › Cube by what is typed into the menu, then G and S an axis at a time."""
    yield from over_the_view()
    yield from keys("shift+a", pause=1.5)
    yield from words("empty cube", 1.5)
    if picture:
        yield from shot(picture)
    yield from keys("Return", pause=1.0)
    yield from over_the_view()
    for key, values in (("g", location), ("s", scale)):
        for axis, value in zip("xyz", values, strict=True):
            yield from keys(key, axis, pause=0.3)
            yield from number(value)


def spot(item):
    """A pixel at which a click means that object."""
    if item.type == "EMPTY":
        return use.pixel(next(use.edge_points(item, 1)))
    points = scenes.world_points(item)
    x, y = use.pixel(points[points[:, 2].argmax()])
    return x, y + 15  # just below the top of her head


def handles():
    yield from cube_empty(*JAW, picture="add-empty")
    yield from cube_empty(*EAR)
    empties = [item for item in bpy.data.objects if item.type == "EMPTY"]
    FOUND["empties"] = [[round(v, 3) for v in (*item.location, *item.scale)] for item in empties]
    suzanne = next(item for item in bpy.data.objects if item.type == "MESH")
    for place, item in enumerate((*empties, suzanne)):
        if place == 1:
            stage.tool("keydown", "shift")
        yield from click(*spot(item))
    stage.tool("keyup", "shift")
    FOUND["selected"] = [item.name for item in bpy.context.selected_objects]
    FOUND["active"] = bpy.context.object.name
    yield from panel.open_alone({"handles"})
    yield from click(*PLUS)
    yield from shot("plus")
    yield from click(*FROM_EMPTIES)
    FOUND["handles"] = [(e.empty.name, e.inside) for e in suzanne.arapfields.handles]
    yield from click(*SECOND_ROW)
    FOUND["row_selects"] = bpy.context.object.name
    yield from shot("handles")
    yield from over_the_view()
    for names, value in ((("r", "y"), -55), (("g", "x"), 0.08), (("g", "z"), 0.38)):
        yield from keys(*names, pause=0.3)
        yield from number(value)


def surface():
    """The tutorial's fifth step as far as the fit."""
    suzanne = next(item for item in bpy.data.objects if item.type == "MESH")
    yield from panel.open_alone({"advanced"})
    row = panel.rows().index("advanced") + 1
    y = yield from inner("surface", row)
    yield from click(FIT[0], y + FIT[1])
    yield from shot("surface")
    yield from click(FIT_SURFACE[0], y + FIT_SURFACE[1], pause=0.5)
    yield from until_idle()
    yield from shot("fitted")
    FOUND["fitted"] = bool(suzanne.arapfields.fit_report)


def inner(section, row):
    """Opens a section within Advanced; where its header is, from the top."""
    place = panel.rows(panel.ADVANCED).index(section)
    yield from panel.press(row, place)
    return round(panel.HEADER[1] + panel.STEP * row + panel.INNER * place)


def results():
    suzanne = next(item for item in bpy.data.objects if item.type == "MESH")
    rest = scenes.world_points(suzanne)
    yield from panel.open_alone({"deform"})
    yield from click(*DEFORM, button=3, pause=1.5)
    yield from shot("right-click")
    yield from keys("Escape", pause=1.0)
    yield from click(*DEFORM, pause=0.0)
    yield from until(lambda: "ARAP Fields" in suzanne.modifiers, 10.0)
    yield from shot("deforming")
    yield from until_idle()
    FOUND["deformed_by"] = round(float(np.abs(scenes.world_points(suzanne) - rest).max()), 3)
    FOUND["stack"] = [m.name for m in suzanne.modifiers]
    yield from shot("deformed")
    deformed = scenes.world_points(suzanne)
    yield from panel.open_alone({"stylize"})
    yield from click(*STYLIZE, pause=0.0)
    yield from until_idle()
    FOUND["stylized_by"] = round(float(np.abs(scenes.world_points(suzanne) - deformed).max()), 3)
    yield from shot("stylized")


def until_idle():
    yield 1.0
    yield from until(lambda: not bpy.ops.arapfields.cancel.poll(), 300.0)
    yield 1.5


def steps():
    yield from found_by_name()
    yield from monkey()
    yield from handles()
    yield from results()
    yield from surface()


def ended(error):
    FOUND.update({"error": error} if error else {"finished": True})
    (OUTPUT / "walk.json").write_text(json.dumps(FOUND, indent=1))
    print(error or "walked", flush=True)


stage.start(steps, ended, OUTPUT)
