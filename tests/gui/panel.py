# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the panel's sections, one open at a time, in English and German, and of handles."""

import bpy
import stage
from support.blender import panels

from addon.blender.section import TASKS
from addon.preferences import ARAPFIELDS_AP_preferences, show
from addon.registration import CLASSES
from addon.tasks.panel import ARAPFIELDS_PT_tasks

PANEL = "ARAPFIELDS_PT_"
ADVANCED, OBJECTS = "ARAPFIELDS_PT_advanced", "ARAPFIELDS_PT_others"
HEADER, STEP = (1120, 221), 28.4  # the first section below the tasks, and the distance of closed sections
INNER = 26.0  # distance of closed sections in Advanced
OTHERS = {"stylize": "STYLE", "wrap": "WRAP", "skin": "RIG", "poses": "RIG"}  # tasks of sections but POSE
OTHERS |= {"animation": "ANIMATE", "secondary": "ANIMATE"}
STYLES = (1150, 251)  # the menu of styles, if its section were the first
SIDEBAR = (1028, 84, 258, 820)  # left, top, width, height


def checks(figures, folder):
    bar, moving = bpy.data.objects["Bar"], bpy.data.objects["Moving"]
    bar.modifiers.new("Subdivision", "SUBSURF")
    moving.location.z, moving.rotation_euler.y = 0.45, -0.5
    bar.arapfields.surface = "FIT"  # has more settings
    yield 4.0  # until the sections have stopped moving
    figures["panel_seen"] = stage.is_panel_seen()
    stage.picture(folder, "handles")
    yield from sections(folder, "panel")
    figures["languages"] = len(bpy.app.translations.locales)
    if "de_DE" in bpy.app.translations.locales:
        view = bpy.context.preferences.view
        view.language = "de_DE"
        yield 1.0
        yield from sections(folder, "german")
        yield from preferences(folder, "german-preferences")
        view.language = "en_US"
        yield 1.0
    yield from preferences(folder, "preferences")
    yield from open_alone({"handles", "deform"})
    bar.modifiers.clear()
    bar.arapfields.surface = "EXACT"
    figures["sections"] = len(
        {row for _ in panels.each_task() for row in (*rows(), *rows(ADVANCED), *rows(OBJECTS))}
    )


def rows(parent=None):
    """The sections that are drawn, from top to bottom: all, or those within another."""
    with stage.override():
        shown = [c for c in CLASSES if c.__name__.startswith(PANEL) and c.poll(bpy.context)]
    shown = [c for c in shown if getattr(c, "bl_parent_id", None) == parent and c != ARAPFIELDS_PT_tasks]
    shown.sort(key=lambda c: c.bl_order)
    return [c.__name__[len(PANEL) :].replace("_", "-") for c in shown]


def choose(task):
    """Shows the sections of a task."""
    bpy.context.scene.arapfields.task = task
    for region in stage.view()[1].regions:
        region.tag_redraw()
    yield 1.0


def sections(folder, name):
    for task in TASKS:
        yield from choose(task)
        yield from sections_of_task(folder, name if task == "POSE" else f"{name}-{task.lower()}")
    yield from choose("POSE")


def sections_of_task(folder, name):
    yield from open_alone(set(), bpy.context.scene.arapfields.task)
    yield from picture(folder, f"{name}-closed")
    for row, section in enumerate(rows()):
        yield from press(row)
        yield from picture(folder, f"{name}-{section}")
        if section == "stylize":
            stage.tool("mousemove", STYLES[0], round(STYLES[1] + STEP * row), "click", 1)
            yield 1.0
            stage.picture(folder, f"{name}-styles")
            yield from stage.keys("Escape", pause=0.5)
        elif section == "advanced":
            yield from within(folder, name, row)
        yield from press(row)


def picture(folder, name):
    """A picture of the sidebar, with the mouse where it highlights nothing."""
    yield from stage.move(500, 940, pause=0.7)
    stage.picture(folder, name, SIDEBAR)


def within(folder, name, row):
    """Pictures of the sections in Advanced, which is open at that row."""
    for number, section in enumerate(rows(ADVANCED)):
        yield from press(row + 1, number)
        yield from picture(folder, f"{name}-{section}")
        yield from press(row + 1, number)


def open_alone(names, task=None):
    """Opens these sections of a task and closes its others; a click with Ctrl closes all but one.

    `task`: by default the one that has these sections.
    """
    yield from choose(task or next((OTHERS[name] for name in names if name in OTHERS), "POSE"))
    for words in (("mousemove", *HEADER), ("keydown", "ctrl"), ("click", 1), ("keyup", "ctrl")):
        stage.tool(*words)
        yield 0.7
    yield from press(0)
    for row, section in reversed(list(enumerate(rows()))):
        if section in names:
            yield from press(row)


def press(row, inner=0):
    stage.tool("mousemove", HEADER[0], round(HEADER[1] + STEP * row + INNER * inner), "click", 1)
    yield 1.0


def preferences(folder, name):
    """A picture of the add-on's preferences, drawn in a popup."""

    class Shown(bpy.types.Operator):
        bl_idname, bl_label = "wm.arapfields_preferences_shown", "ARAP Fields"
        __annotations__ = dict(ARAPFIELDS_AP_preferences.__annotations__)

        def draw(self, context):
            show(self.layout, self.properties)

        def invoke(self, context, event):
            return context.window_manager.invoke_props_dialog(self, width=500)

        def execute(self, context):
            return {"FINISHED"}

    bpy.utils.register_class(Shown)
    yield from stage.move(500, 400, pause=0.5)
    with stage.override():
        bpy.ops.wm.arapfields_preferences_shown("INVOKE_DEFAULT")
    yield 1.0
    stage.picture(folder, name)
    yield from stage.keys("Escape", pause=0.7)
    bpy.utils.unregister_class(Shown)
