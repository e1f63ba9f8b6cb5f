# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the panel's sections, one open at a time, and of the handles in the viewport."""

import bpy
import stage

SECTIONS = ("source", "surface", "handles", "deform", "stylize", "result", "status")
HEADER, STEP = (1120, 97), 28.4  # the sidebar's first header, and from one closed section to the next
STYLES = (1150, 217)  # the menu of styles below the header of its section


def checks(found, folder):
    bar, moving = bpy.data.objects["Bar"], bpy.data.objects["Moving"]
    bar.modifiers.new("Subdivision", "SUBSURF")
    moving.location.z, moving.rotation_euler.y = 0.45, -0.5
    yield 1.0
    stage.picture(folder, "handles")
    for words in (("mousemove", *HEADER), ("keydown", "ctrl"), ("click", 1), ("keyup", "ctrl")):
        stage.tool(*words)  # closes all other sections
        yield 0.7
    press(0)
    yield 1.0
    stage.picture(folder, "panel-closed")
    for row, name in enumerate(SECTIONS):
        press(row)
        yield 1.0
        stage.picture(folder, f"panel-{name}")
        if name == "stylize":
            stage.tool("mousemove", STYLES[0], STYLES[1] + STEP * row, "click", 1)
            yield 1.0
            stage.picture(folder, "styles")
            stage.tool("key", "Escape")
            yield 0.5
        press(row)
        yield 0.7
    for row in (3, 2, 1, 0):
        press(row)
        yield 0.3
    bar.modifiers.clear()
    found["sections"] = len(SECTIONS)


def press(row):
    stage.tool("mousemove", HEADER[0], HEADER[1] + STEP * row, "click", 1)
