# SPDX-License-Identifier: GPL-3.0-or-later
"""A job beside the window's events: looked at by a timer, shown no more often than drawing allows."""

import time

import bpy

from ..blender import settings
from ..blender.language import translated
from ..core.runtime import jobs
from ..core.runtime.coroutines import work
from ..core.runtime.threads import Pace
from ..names import CATEGORY
from ..viewport import previews

TICK = 0.03  # seconds between looks at the worker
BUDGET = 0.02  # seconds that the main thread works at once


class ModalRun:
    """Mixin of operators with a `course(context)`: a generator of what the main thread does for a job."""

    has_window = False  # whether it runs beside the window's events

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self.has_window, self._looks, self._shown = True, 0, None
        self._progress_pace, self._preview_pace = Pace(0.25), Pace(0.4)
        self._left = time.monotonic()
        self._course = self.course(context)
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)
        context.window_manager.modal_handler_add(self)
        return self.advance(context)

    def modal(self, context, event):
        job = jobs.running()
        if job is None:  # stopped from outside: a file is loaded, a step undone, the add-on disabled
            self.leave(context)
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            job.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        return self.advance(context)

    def advance(self, context):
        """Works for a moment on what the main thread has to do, and shows how far the job is."""
        begin = time.monotonic()
        for pace in (self._progress_pace, self._preview_pace):
            pace.spent(begin - self._left - TICK)
        try:
            work(self._course, BUDGET)
        except StopIteration as ended:
            self.leave(context)
            return ended.value
        except Exception:
            self.leave(context)
            raise
        self.show_progress(context, jobs.running())
        self._left = time.monotonic()
        return {"RUNNING_MODAL"}

    def show_progress(self, context, job):
        """Redraws the viewport for a new preview and the sidebar for new words, each when it is due."""
        now = time.monotonic()
        if self._preview_pace.due(now) and settings.show_previews():
            item, looks, points = job.sight()
            if looks and looks != self._looks and item.preview is not None:
                item.preview.show(points)
                redraw(context, "WINDOW")
                self._preview_pace.begin(now)
                self._looks = looks
        words = f"{job.message}  {job.fraction:.0%}"
        if words != self._shown and self._progress_pace.due(now):
            redraw(context, "UI")
            context.workspace.status_text_set(f"{words}  {translated('(ESC cancels)')}")
            self._progress_pace.begin(now)
            self._shown = words

    def cancel(self, context):
        """Blender ends the operator: its window closes or a file is loaded."""
        self.leave(context)

    def leave(self, context):
        self._course.close()
        jobs.stop()
        previews.clear()
        context.window_manager.event_timer_remove(self._timer)
        if context.workspace:
            context.workspace.status_text_set(None)
        redraw(context, "UI", "WINDOW")


def redraw(context, *kinds):
    """Has regions of these kinds of every 3D view drawn again; of sidebars those that show the panel."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type in kinds and shows_ours(region):
                        region.tag_redraw()


def shows_ours(region):
    """Whether what this region shows can depend on a job: not another tab, nor a closed sidebar."""
    if region.type != "UI":
        return True
    return region.width > 1 and getattr(region, "active_panel_category", CATEGORY) == CATEGORY
