# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the panel's sections, one open at a time, in English and German; of handles in the viewport."""

import bpy
import stage

SECTIONS = ("source", "surface", "handles", "deform", "stylize", "result", "status")
HEADER, STEP = (1120, 97), 28.4  # the sidebar's first header, and from one closed section to the next
STYLES = (1150, 217)  # the menu of styles below the header of its section
SIDEBAR = (1028, 84, 258, 820)  # left, top, width, height


def checks(found, folder):
    bar, moving = bpy.data.objects["Bar"], bpy.data.objects["Moving"]
    bar.modifiers.new("Subdivision", "SUBSURF")
    moving.location.z, moving.rotation_euler.y = 0.45, -0.5
    yield 1.0
    stage.picture(folder, "handles")
    yield from sections(folder, "panel")
    found["languages"] = len(bpy.app.translations.locales)
    if "de_DE" in bpy.app.translations.locales:
        view = bpy.context.preferences.view
        view.language = "de_DE"
        yield 1.0
        yield from sections(folder, "german")
        yield from preferences(folder, "german-preferences")
        view.language = "en_US"
        yield 1.0
    yield from preferences(folder, "preferences")
    yield from open_alone({"source", "surface", "handles", "deform"})
    bar.modifiers.clear()
    found["sections"] = len(SECTIONS)


def sections(folder, name):
    yield from open_alone(set())
    stage.picture(folder, f"{name}-closed", SIDEBAR)
    for row, section in enumerate(SECTIONS):
        yield from press(row)
        stage.picture(folder, f"{name}-{section}", SIDEBAR)
        if section == "stylize":
            stage.tool("mousemove", STYLES[0], STYLES[1] + STEP * row, "click", 1)
            yield 1.0
            stage.picture(folder, f"{name}-styles")
            stage.tool("key", "Escape")
            yield 0.5
        yield from press(row)


def open_alone(names):
    """Opens these sections and closes all others: with Ctrl a click closes all but one."""
    for words in (("mousemove", *HEADER), ("keydown", "ctrl"), ("click", 1), ("keyup", "ctrl")):
        stage.tool(*words)
        yield 0.7
    yield from press(0)
    for row in reversed(range(len(SECTIONS))):
        if SECTIONS[row] in names:
            yield from press(row)


def press(row):
    stage.tool("mousemove", HEADER[0], HEADER[1] + STEP * row, "click", 1)
    yield 1.0


def preferences(folder, name):
    """The add-on's preferences, drawn in a popup of their own."""
    from addon.preferences import ARAPFIELDS_AP_preferences

    class Shown(bpy.types.Operator):
        bl_idname, bl_label = "wm.arapfields_preferences_shown", "ARAP Fields"
        __annotations__ = dict(ARAPFIELDS_AP_preferences.__annotations__)
        draw = ARAPFIELDS_AP_preferences.draw

        def invoke(self, context, event):
            return context.window_manager.invoke_props_dialog(self, width=500)

        def execute(self, context):
            return {"FINISHED"}

    bpy.utils.register_class(Shown)
    stage.tool("mousemove", 500, 400)
    yield 0.5
    with stage.override():
        bpy.ops.wm.arapfields_preferences_shown("INVOKE_DEFAULT")
    yield 1.0
    stage.picture(folder, name)
    stage.tool("key", "Escape")
    yield 0.7
    bpy.utils.unregister_class(Shown)
