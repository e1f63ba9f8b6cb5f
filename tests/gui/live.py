# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode in the window: update rate of the viewport, one undo step per drag, restoring at its end."""

import time

import bpy
import numpy as np
import stage
from mouse import until_live_rests
from support.blender import scenes

from addon.field_modifier import motion
from addon.live import sessions
from addon.solver.frame_solver import FrameSolver

SECONDS = 5.0
PATIENT = 60.0  # the same if a busy machine has shown no shape until then


def checks(figures, folder):
    yield from rate(figures, folder)
    yield from drag(figures, folder)


def rate(figures, folder):
    """Moves a handle of a mesh of 50,000 vertices, and measures how often the viewport shows a new shape."""
    stage.empty_file()
    with stage.override():
        bar, _, moving = scenes.bar_with_handles()
        stage.dense_bar()
        bpy.ops.view3d.view_all()
        scenes.activate(bar)
        solves = stage.Meter().watch(FrameSolver, "follow")
        begin = time.perf_counter()
        bpy.ops.arapfields.live("INVOKE_DEFAULT")
        figures["live_click_s"] = round(time.perf_counter() - begin, 4)
    session = sessions.live[bar.session_uid]
    while not session.worker.is_settled:
        yield 0.01
    figures["live_first_shape_s"] = round(time.perf_counter() - begin, 4)
    figures["live_vertices"] = len(bar.data.vertices)
    _, area, _ = stage.view()
    for name, overlays, samples in (("as_it_opens", True, "8"), ("plain", False, "OFF")):
        area.spaces.active.overlay.show_overlays = overlays
        bpy.context.preferences.system.viewport_aa = samples
        yield 1.0
        yield from one_rate(figures, name, moving)
    figures["live_solve_and_warp_on_worker"] = solves.end()
    figures["live_without_drawing"] = without_drawing(moving)
    stage.picture(folder, "live-plain")
    area.spaces.active.overlay.show_overlays = True
    bpy.context.preferences.system.viewport_aa = "8"
    yield from until_live_rests()
    figures["live_refined"] = {"converged": session.solver.report.converged}
    yield 1.0
    stage.picture(folder, "live")
    with stage.override():
        sessions.end(bpy.context, bar)


def one_rate(figures, name, moving):
    shown, ticks = stage.Meter(), stage.Meter()
    ticks.watch(sessions, "update")
    shown.watch(motion, "write")
    times, stop = stage.draws()
    begin, seconds = time.perf_counter(), 0.0
    while seconds < SECONDS or (not shown.wall and seconds < PATIENT):
        share = min(seconds / SECONDS, 1.0)
        moving.location.z, moving.rotation_euler.x = 0.6 * share, 1.2 * share
        yield 0.004
        seconds = time.perf_counter() - begin
    stop()
    updates = shown.end()
    figures[f"live_{name}"] = {
        "updates_per_second": updates["calls"] / seconds,
        "draws_per_second": len(times) / seconds,
        "main_thread_each_look": ticks.end(),
        "bare_redraw_s": stage.redraw_seconds(),
    }


def without_drawing(moving):
    """Updates per second without drawing: solve, warp, mesh and dependency graph in sequence.

    Each is the first shape for the handle's location.
    """
    (session,) = sessions.live.values()
    begin, count = time.perf_counter(), 0
    while time.perf_counter() - begin < SECONDS / 2:
        count += 1
        moving.location.z = 0.6 * abs(np.sin(0.05 * count))
        bpy.context.view_layer.update()
        sessions.update(bpy.context)
        while session.solver.solved_request is not session.requested:
            time.sleep(0.0003)
        session.show()
        bpy.context.view_layer.update()
    return {"updates_per_second": round(count / (time.perf_counter() - begin), 1)}


def drag(figures, folder):
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
    stage.tool("mousemove", 600, 500)
    yield 0.3
    stage.tool("key", "g")
    yield 0.3
    for step in range(1, 9):
        stage.tool("mousemove", 600 + 8 * step, 500 - 12 * step)
        yield 0.15
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
