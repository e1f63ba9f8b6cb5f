# SPDX-License-Identifier: GPL-3.0-or-later
"""Performs the tutorial by mouse and keys only, and searches as a new user does; a picture after each step.

If the extension is installed, its first messages are shown; else this clone's add-on is registered. A window
of 1600 × 1000 is assumed.
"""

import bpy
import numpy as np
import panel
import stage
import use
from mouse import click, keys, pixel, until, until_idle
from support.blender import scenes
from tutorial import EAR, JAW

from addon.live import sessions

F3, MINUS = "69", "20"  # key codes: by name the X server may press Alt as well
MIDDLE = (560, 520)  # of the 3D view
# Positions in the sidebar with one open section: the list's + and its rows, Deform and Stylize.
PLUS, FROM_EMPTIES, SECOND_ROW = (1261, 234), (1340, 255), (1130, 256)
DEFORM, STYLIZE = (1140, 298), (1140, 361)
FIT, FIT_SURFACE = (1252, 25), (1130, 80)  # below the header of Implicit Surface in Advanced


def words(text, pause=1.0):
    stage.tool("type", "--delay", 60, text)
    yield pause


def number(value):
    """Types a number during a transform, and confirms it."""
    yield from words(f"{abs(value):g}", 0.5)
    if value < 0:
        yield from keys(MINUS, pause=0.3)
    yield from keys("Return", pause=0.6)


def over_the_view():
    stage.tool("mousemove", *MIDDLE)
    yield 0.5


def searched(text):
    """Presses F3 and types a text; Return then runs the first result."""
    yield from over_the_view()
    yield from keys(F3, pause=2.0)
    yield from words(text, 2.0)


def shot(folder, name):
    yield 0.6
    stage.picture(folder, f"walk-{name}")


def found_by_name(figures, folder):
    yield from shot(folder, "welcome")
    yield from keys("Escape")
    for text in ("arap", "pin", "deform", "stylize"):
        yield from searched(text)
        yield from shot(folder, f"f3-{text}")
        yield from keys("Escape", "Escape")
    with stage.override():
        bpy.ops.wm.call_menu(name="VIEW3D_MT_empty_add")
    yield from shot(folder, "empties")
    yield from keys("Escape", pause=1.0)


def monkey(figures, folder):
    for item in list(bpy.data.objects):  # the tutorial begins with only Suzanne
        item.select_set(item.type == "MESH")
    yield from over_the_view()
    yield from keys("x", pause=1.0)
    yield from keys("Return", pause=1.0)
    yield from searched("add mesh monkey")
    yield from keys("Return", pause=2.0)
    figures["suzanne"] = [item.name for item in bpy.data.objects if item.type == "MESH"]
    yield from over_the_view()
    yield from keys("ctrl+2", pause=1.5)
    yield from searched("shade smooth")
    yield from keys("Return", pause=2.0)
    yield from over_the_view()
    yield from keys("n", pause=1.5)
    stage.tool("mousemove", *stage.TAB, "click", 1)
    yield 1.5
    figures["modifiers"] = [m.type for m in bpy.context.object.modifiers]
    yield from shot(folder, "suzanne")


def cube_empty(folder, location, scale, picture=""):
    """Adds an Empty by typing into the Add menu, then moves and scales it along each axis."""
    yield from over_the_view()
    yield from keys("shift+a", pause=1.5)
    yield from words("empty cube", 1.5)
    if picture:
        yield from shot(folder, picture)
    yield from keys("Return", pause=1.0)
    yield from over_the_view()
    for key, values in (("g", location), ("s", scale)):
        for axis, value in zip("xyz", values, strict=True):
            yield from keys(key, axis, pause=0.3)
            yield from number(value)


def spot(item):
    """A pixel at which a click selects that object."""
    if item.type == "EMPTY":
        return pixel(next(use.edge_points(item, 1)))
    points = scenes.world_points(item)
    x, y = pixel(points[points[:, 2].argmax()])
    return x, y + 15  # just below the top of her head


def handles(figures, folder):
    yield from cube_empty(folder, *JAW, picture="add-empty")
    yield from cube_empty(folder, *EAR)
    empties = [item for item in bpy.data.objects if item.type == "EMPTY"]
    figures["empties"] = [[round(v, 3) for v in (*item.location, *item.scale)] for item in empties]
    suzanne = next(item for item in bpy.data.objects if item.type == "MESH")
    for place, item in enumerate((*empties, suzanne)):
        if place == 1:
            stage.tool("keydown", "shift")
        yield from click(spot(item), pause=1.2)
    stage.tool("keyup", "shift")
    figures["selected"] = [item.name for item in bpy.context.selected_objects]
    figures["active"] = bpy.context.object.name
    yield from panel.open_alone({"handles"})
    yield from click(PLUS, pause=1.2)
    yield from shot(folder, "plus")
    yield from click(FROM_EMPTIES, pause=1.2)
    figures["handles"] = [(e.empty.name, e.inside) for e in suzanne.arapfields.handles]
    yield from click(SECOND_ROW, pause=1.2)
    figures["row_selects"] = bpy.context.object.name
    yield from shot(folder, "handles")
    yield from over_the_view()
    for names, value in ((("r", "y"), -55), (("g", "x"), 0.08), (("g", "z"), 0.38)):
        yield from keys(*names, pause=0.3)
        yield from number(value)


def surface(figures, folder):
    """The tutorial's fifth step, up to the fit."""
    suzanne = next(item for item in bpy.data.objects if item.type == "MESH")
    yield from panel.open_alone({"advanced"})
    row = panel.rows().index("advanced") + 1
    y = yield from inner("surface", row)
    yield from click((FIT[0], y + FIT[1]), pause=1.2)
    yield from shot(folder, "surface")
    yield from click((FIT_SURFACE[0], y + FIT_SURFACE[1]), pause=0.5)
    yield 1.0
    yield from until_idle(300.0)
    yield 1.5
    yield from shot(folder, "fitted")
    figures["fitted"] = bool(suzanne.arapfields.fit_report)


def inner(section, row):
    """Opens a section in Advanced; returns the position of its header from the top."""
    place = panel.rows(panel.ADVANCED).index(section)
    yield from panel.press(row, place)
    return round(panel.HEADER[1] + panel.STEP * row + panel.INNER * place)


def results(figures, folder):
    suzanne = next(item for item in bpy.data.objects if item.type == "MESH")
    rest = scenes.world_points(suzanne)
    yield from panel.open_alone({"deform"})
    yield from click(DEFORM, button=3, pause=1.5)
    yield from shot(folder, "right-click")
    yield from keys("Escape", pause=1.0)
    yield from click(DEFORM, pause=0.0)
    yield from until(lambda: "ARAP Fields" in suzanne.modifiers, 10.0)
    yield from shot(folder, "deforming")
    yield 1.0
    yield from until_idle(300.0)
    yield 1.5
    figures["deformed_by"] = round(float(np.abs(scenes.world_points(suzanne) - rest).max()), 3)
    figures["stack"] = [m.name for m in suzanne.modifiers]
    yield from shot(folder, "deformed")
    deformed = scenes.world_points(suzanne)
    yield from panel.open_alone({"stylize"})
    yield from click(STYLIZE, pause=0.0)
    yield 1.0
    yield from until_idle(300.0)
    yield 1.5
    figures["stylized_by"] = round(float(np.abs(scenes.world_points(suzanne) - deformed).max()), 3)
    figures["stylized_live"] = len(sessions.live)
    yield from shot(folder, "stylized")


def checks(figures, folder):
    for part in (found_by_name, monkey, handles, results, surface):
        yield from part(figures, folder)
