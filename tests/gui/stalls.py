# SPDX-License-Identifier: GPL-3.0-or-later
"""Delays of the window's event loop: at rest, when drawing, beside a job, by progress and previews.

The delay of a timer of 10 ms measures how long the event loop was blocked. Blender's drawing counts as well:
each part is measured after the window has come to rest, without and with a job's drawing.
"""

import contextlib
import time

import bpy
import numpy as np
import stage
from mouse import until_idle
from support.blender import scenes

from addon.core.runtime import jobs, threads
from addon.jobs import display, modal

LONG = {**scenes.NEW, "field": "neural", "iterations": 100000, "width": 256, "layers": 4, "batch": 300}
SECONDS = 4.0


def checks(figures, folder):
    window = bpy.context.window_manager.windows[0]
    figures["window"] = f"{window.width} x {window.height}"
    samples = bpy.context.preferences.system.viewport_aa
    for name, anti_aliasing, overlays in (("plain", "OFF", False), ("as_it_opens", samples, True)):
        bpy.context.preferences.system.viewport_aa = anti_aliasing
        stage.view()[1].spaces.active.overlay.show_overlays = overlays
        yield from parts(figures.setdefault(name, {}))


def parts(figures):
    yield from scene()
    yield from lateness(figures, "at_rest")
    for kind in ("nothing", "STATUSBAR", "UI", "WINDOW"):
        yield from one_redraw(figures, kind)
    equal = (threads, "lower_thread_priority", lambda: None)
    silent = (modal.ModalRun, "show_progress", lambda *_: None)
    unseen = (display.user_preferences, "shows", lambda name: name != "show_previews")
    for name, changes in (
        ("job_not_shown_same_priority", (equal, silent)),
        ("job_not_shown", (silent,)),
        ("job_with_progress", (unseen,)),
        ("job_with_progress_and_previews", ()),
    ):
        with contextlib.ExitStack() as stack:
            for change in changes:
                stack.enter_context(replaced(*change))
            yield from with_a_job(figures, name)


def scene():
    stage.empty_file()
    with stage.override():
        _, _, moving = scenes.bar_with_handles()
        bpy.ops.view3d.view_all()
    moving.location.z += 0.5
    moving.rotation_euler.y = 0.6
    yield from at_rest()


def with_a_job(figures, name):
    with stage.override():
        scenes.activate(bpy.data.objects["Bar"])
        bpy.ops.arapfields.deform("INVOKE_DEFAULT", **LONG)
    yield from at_rest(limit=6.0)
    job = jobs.running()
    begun, begin = job.fraction, time.perf_counter()
    yield from lateness(figures, name)
    figures[name]["job_percent_per_second"] = round(
        100 * (job.fraction - begun) / (time.perf_counter() - begin), 4
    )
    if name.startswith("job_not_shown"):
        for kind in ("UI", "WINDOW"):
            yield from one_redraw(figures[name], kind)
    bpy.ops.arapfields.cancel()
    yield from until_idle()
    yield from at_rest()


def at_rest(calm=0.6, limit=60.0):
    """Waits until nothing has been drawn for a while: Blender refines pictures in several drawings."""
    times, stop = stage.draws()
    begin = now = busy = time.perf_counter()
    while now - max([busy, *times[-1:]]) < calm and now - begin < limit:
        yield 0.02
        before, now = now, time.perf_counter()
        busy = now if now - before > 0.05 else busy  # drawing of sidebars and the like, without callbacks
    stop()


def lateness(figures, name):
    """Delay of a timer of 10 ms, and the share of time in which the event loop was blocked for over 50 ms."""
    late = []
    drawn, stop = stage.draws()
    begin = last = time.perf_counter()
    while last - begin < SECONDS:
        yield 0.01
        now = time.perf_counter()
        late.append(now - last - 0.01)
        last = now
    stop()
    late = np.array(late)
    figures[name] = {
        "longest_ms": round(1e3 * float(late.max()), 1),
        "median_ms": round(1e3 * float(np.median(late)), 1),
        "over_50_ms": int((late > 0.05).sum()),
        "held_share": round(float(late[late > 0.05].sum() / (last - begin)), 3),
        "viewport_drawings": len(drawn),
    }


def one_redraw(figures, kind):
    """Time of one redraw of one kind of region, until the next iteration of the event loop."""
    times = []
    for number in range(5):
        yield from at_rest()
        if kind == "STATUSBAR":
            bpy.context.workspace.status_text_set(f"{number}")
        for region in stage.view()[1].regions:
            if region.type == kind:
                region.tag_redraw()
        begin = time.perf_counter()
        yield 0.0
        times.append(time.perf_counter() - begin)
    bpy.context.workspace.status_text_set(None)
    yield from at_rest()
    figures[f"redraw_{kind}_ms"] = round(1e3 * float(np.median(times)), 1)


@contextlib.contextmanager
def replaced(owner, name, value):
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)
