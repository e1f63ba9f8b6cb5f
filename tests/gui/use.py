# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles by mouse: faces of boxes, a drag in live mode; and the status bar."""

import bpy
import jobs as window_jobs
import numpy as np
import stage
from mathutils import Vector
from stage import pixel, until_idle, until_live_rests
from support.blender import scenes

from addon.core.runtime import jobs
from addon.live import sessions

CANCEL = (45, 12)  # pixels from the window's lower right corner to the middle of the status bar's button


def checks(figures, folder):
    yield from face(figures, folder)
    yield from cancel(figures, folder)


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
    yield from stage.move(x - 3, y - 3, pause=0.5)
    yield from stage.move(x, y, pause=0.8)
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


def live_checks(figures, folder):
    """Drags with the mouse: one undo step, which restores the shape."""
    stage.empty_file()
    with stage.override():
        bar, _, moving = scenes.bar_with_handles()
        bpy.ops.view3d.view_all()
        scenes.activate(bar)
    before = stage.everything()
    with stage.override():
        bpy.ops.arapfields.live("INVOKE_DEFAULT")
        scenes.activate(moving)
        moving["mark"] = 1
        bpy.ops.ed.undo_push(message="mark")
    yield from until_live_rests()
    rest = stage.positions("Bar")
    yield from stage.move(600, 500, pause=0.3)
    yield from stage.keys("g", pause=0.3)
    for step in range(1, 9):
        yield from stage.move(600 + 8 * step, 500 - 12 * step, pause=0.15)
    stage.tool("click", 1)
    yield 1.0
    yield from until_live_rests()
    moving = bpy.data.objects["Moving"]
    moved = stage.positions("Bar")
    stage.picture(folder, "dragged")
    figures["drag_moved_handle"] = round(float(np.linalg.norm(moving.location - bar.location) - 1), 4)
    figures["drag_moved_shape"] = round(float(np.abs(moved - rest).max()), 4)
    with stage.override():
        bpy.ops.ed.undo()
    yield 1.0
    yield from until_live_rests()
    figures["live_after_undo"] = sessions.is_live(bpy.data.objects["Bar"])
    moving = bpy.data.objects["Moving"]
    back = np.allclose(moving.location, (1, 0, 0), atol=1e-6) and moving.get("mark") == 1
    figures["drag_is_one_undo_step"] = bool(back)
    figures["shape_returns_with_undo"] = round(float(np.abs(stage.positions("Bar") - rest).max()), 6)
    bar = bpy.data.objects["Bar"]
    del moving["mark"]
    with stage.override():
        scenes.activate(bar)
        sessions.end(bpy.context, bar)
    figures["off_restores"] = stage.everything() == before and not bar.modifiers
