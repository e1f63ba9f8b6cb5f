# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs in the window: progress, previews, cancelling and undo, and their end when a file is loaded."""

import time

import bpy
import numpy as np
import stage
from stage import until, until_idle
from support.blender import scenes

from addon.core.runtime import jobs
from addon.handles import overlays

SIDEBAR = (1150, 700)  # a spot over it
LONG = {**scenes.NEW, "iterations": 200000}


def invoke(settings):
    with stage.override():
        scenes.activate(bpy.data.objects["Bar"])
        return str(bpy.ops.arapfields.deform("INVOKE_DEFAULT", **settings))


def checks(figures, folder):
    stage.empty_file()
    with stage.override():
        _, _, moving = scenes.bar_with_handles()
        bpy.ops.view3d.view_all()
    yield 1.0
    moving.location.z += 0.5
    moving.rotation_euler.y = 0.6
    bpy.context.view_layer.update()
    before = stage.everything()
    bpy.ops.ed.undo_push(message="before")
    shown, show = [], overlays.Preview.show
    overlays.Preview.show = lambda *given: (shown.append(True), show(*given))[1]
    begin = time.perf_counter()
    figures["invoke"] = invoke(LONG)
    figures["click_s"] = round(time.perf_counter() - begin, 4)
    yield 6.0
    figures["running"] = jobs.running() is not None
    stage.picture(folder, "running-apart")
    overlays.Preview.show = show
    figures["previews"] = len(shown)
    begin = time.perf_counter()
    bpy.ops.arapfields.cancel()
    yield from until_idle(30)
    figures["cancel_s"] = round(time.perf_counter() - begin, 4)
    figures["exact_after_cancel"] = stage.everything() == before
    yield 4.0  # until the panel's sections have stopped moving
    stage.picture(folder, "cancelled")
    yield from in_place(figures, folder, before)
    yield from escape(figures, before)
    yield from result(figures, folder)


def in_place(figures, folder, before):
    """The mesh shows the preview, and is restored after Cancel."""
    rest = stage.positions("Bar")
    invoke({**LONG, "result": "MODIFIER"})
    yield from until(lambda: np.abs(stage.positions("Bar") - rest).max() > 0.3)
    yield 1.0
    stage.picture(folder, "running")
    figures["shown_on_the_mesh"] = round(float(np.abs(stage.positions("Bar") - rest).max()), 3)
    bpy.ops.arapfields.cancel()
    yield from until_idle(30)
    figures["exact_after_cancel_in_place"] = stage.everything() == before
    yield 1.0


def escape(figures, before):
    """Cancels by the key over the view, which does no such thing over the sidebar or in a popup."""
    invoke(LONG)
    yield from stage.move(*SIDEBAR, pause=1.5)
    yield from stage.keys("Escape", pause=1.5)
    figures["escape_over_the_sidebar_cancels"] = jobs.running() is None or jobs.running().cancelled
    yield from stage.move(600, 500, pause=0.5)
    yield from stage.keys("shift+a", "Escape", pause=1.5)
    figures["escape_of_a_popup_cancels"] = jobs.running() is None or jobs.running().cancelled
    begin = time.perf_counter()
    stage.tool("key", "Escape")
    yield from until_idle(30)
    figures["escape_s"] = round(time.perf_counter() - begin, 4)
    figures["exact_after_escape"] = stage.everything() == before


def result(figures, folder):
    invoke(scenes.NEW)
    yield from until_idle(120)
    modal = stage.positions("Bar_deformed")
    figures["preview_gone"] = overlays.shown.mesh is None
    yield 0.5
    stage.picture(folder, "result")
    was_made = "Bar_deformed" in bpy.data.objects
    with stage.override():
        bpy.ops.ed.undo()
    gone = "Bar_deformed" not in bpy.data.objects
    figures["one_undo_step"] = was_made and gone and abs(bpy.data.objects["Moving"].location.z - 0.5) < 1e-6
    with stage.override():
        scenes.activate(bpy.data.objects["Bar"])
        bpy.ops.arapfields.deform("EXEC_DEFAULT", **scenes.NEW)
    figures["modal_against_blocking"] = float(np.abs(stage.positions("Bar_deformed") - modal).max())


def endings(figures, folder):
    """A job during undo, the load of a file, and the add-on's disabling."""
    for name, act in (
        ("undo", lambda: bpy.ops.ed.undo()),
        ("load", lambda: bpy.ops.wm.read_homefile(use_empty=True)),
    ):
        stage.empty_file()
        with stage.override():
            scenes.bar_with_handles()
            bpy.ops.ed.undo_push(message="one")
            bpy.ops.ed.undo_push(message="two")
        invoke(LONG)
        yield 1.0
        running = jobs.running() is not None
        begin = time.perf_counter()
        with stage.override():
            act()
        figures[f"ends_on_{name}"] = running and jobs.running() is None
        figures[f"ends_on_{name}_s"] = round(time.perf_counter() - begin, 4)
        yield 1.0
