# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of boxes, search and the status bar, by mouse."""

import bpy
import jobs as window_jobs
import stage
from mathutils import Vector
from mouse import pixel, until_idle
from support.blender import scenes

from addon.core.runtime import jobs

CANCEL = (45, 12)  # pixels from the window's lower right corner to the middle of the status bar's button


def checks(figures, folder):
    yield from face(figures, folder)
    yield from search(figures, folder)
    yield from cancel(figures, folder)


def edge_points(empty, count):
    """Points on edges of the Empty's cube."""
    ends = [((-1, -1, -1), (1, -1, -1)), ((-1, -1, 1), (1, -1, 1)), ((-1, -1, -1), (-1, -1, 1))]
    for a, b in ends[:count]:
        yield empty.matrix_world @ (0.7 * Vector(a) + 0.3 * Vector(b))


def face(figures, folder):
    """Drags a face of the active box outwards: one undo step, and the handle holds more samples."""
    stage.empty_file()
    with stage.override():
        bar, fixed, _ = scenes.bar_with_handles()
        bpy.ops.view3d.view_all()
        scenes.activate(fixed)
        bpy.ops.ed.undo_push(message="before")
    yield 1.5
    before, held = fixed.scale.x, bar.arapfields.handles[0].inside
    at = fixed.matrix_world @ Vector((1, 0, 0))
    x, y = pixel(at)
    x2, y2 = pixel(at + Vector((0.3, 0, 0)))
    stage.tool("mousemove", x - 3, y - 3)
    yield 0.5
    stage.tool("mousemove", x, y)
    yield 0.8
    stage.picture(folder, "face")
    stage.tool("mousedown", 1)
    yield 0.5
    for share in (0.25, 0.5, 0.75, 1.0):
        stage.tool("mousemove", round(x + share * (x2 - x)), round(y + share * (y2 - y)))
        yield 0.3
    stage.tool("mouseup", 1)
    yield 1.0
    stage.picture(folder, "face-dragged")
    figures["face_dragged"] = round(bpy.data.objects["Fixed"].scale.x / before, 3)
    figures["face_holds_more"] = bpy.data.objects["Bar"].arapfields.handles[0].inside > held
    with stage.override():
        bpy.ops.ed.undo()
    yield 0.5
    figures["face_is_one_undo_step"] = abs(bpy.data.objects["Fixed"].scale.x - before) < 1e-6


def search(figures, folder):
    """Blender's search finds the operators by the add-on's name and by their function."""
    for words in ("arap", "deform", "stylize"):
        stage.tool("mousemove", 400, 600)
        yield 0.5
        with stage.override():
            bpy.ops.wm.search_menu("INVOKE_DEFAULT")
        yield 4.0
        stage.tool("type", words)
        yield 3.0
        stage.picture(folder, f"search-{words}")
        stage.tool("key", "Escape")
        yield 0.7
    figures["searched"] = True


def cancel(figures, folder):
    """The status bar's button cancels a job, also without the panel."""
    window, area, _ = stage.view()
    area.spaces.active.show_region_ui = False
    window_jobs.invoke(window_jobs.LONG)
    yield 4.0
    stage.picture(folder, "status-bar")
    running = jobs.running() is not None
    stage.tool("mousemove", window.width - CANCEL[0], window.height - CANCEL[1], "click", 1)
    yield from until_idle(20)
    figures["cancelled_in_the_status_bar"] = running and jobs.running() is None
    area.spaces.active.show_region_ui = True
    yield 1.0
