# SPDX-License-Identifier: GPL-3.0-or-later
"""A job's preview in the viewport, and its progress in the status bar."""

import time

import bpy

from ..blender import host, user_preferences
from ..blender.host import redraw
from ..blender.language import translated
from ..core.runtime import jobs
from ..core.runtime.jobs import RedrawThrottle
from ..names import Op

# Display of the running job in the window, and the timer that drives it; removed with the job.

TICK = 0.03  # seconds between timer events


class Display:
    """Status bar, sidebar and preview of one job at a time, with throttled redraws."""

    def __init__(self):
        self._timer, self._previews, self.status = None, [], ""
        self._words, self._seen, self._left = "", None, 0.0

    def begin(self, context):
        self._timer = host.start_events(context, TICK)
        self._words, self._seen, self._left = "", None, time.monotonic()
        self._progress_throttle, self._preview_throttle = RedrawThrottle(0.25), RedrawThrottle(0.4)

    def note_arrival(self):
        """Called at each timer event; the event's delay measures the time that redraws take."""
        late = time.monotonic() - self._left - TICK
        for throttle in (self._progress_throttle, self._preview_throttle):
            throttle.add_cost(late)

    def note_departure(self):
        self._left = time.monotonic()

    def show(self, context, job):
        """Redraws the viewport for a new preview and the sidebar for a new message, each when it is due."""
        now = time.monotonic()
        if self._preview_throttle.is_due(now) and user_preferences.shows("show_previews"):
            item, count, points = job.preview_points()
            if count and (item, count) != self._seen and item.preview is not None:
                self._seen = item, count
                if item.preview not in self._previews:
                    self._previews.append(item.preview)
                item.preview.show(points)
                redraw(context, "WINDOW")
                self._preview_throttle.begin(now)
        words = f"{job.message}  {job.fraction:.0%}"
        if words != self._words and self._progress_throttle.is_due(now):
            redraw(context, "UI")
            context.workspace.status_text_set(self.status or None)  # draws the status bar anew
            self._progress_throttle.begin(now)
            self._words = words

    def clear_previews(self):
        """Removes the previews of results."""
        while self._previews:
            self._previews.pop().clear()

    def clear(self):
        """Removes the display when the job has ended, or when the extension is disabled."""
        self.clear_previews()
        if self._timer is not None:
            host.stop_events(self._timer)
            for workspace in list(bpy.data.workspaces):
                workspace.status_text_set(self.status or None)
            redraw(bpy.context, "UI", "WINDOW")
        self._timer = None


def show_status(text):
    """Puts a text into the status bar of all windows; "" restores Blender's own."""
    display.status = text
    for window in bpy.context.window_manager.windows:
        window.workspace.status_text_set(text or None)


display = Display()


# The running job's progress, in the window's status bar, which is visible without the sidebar.


def draw(header, context):
    """Draws what the job is at, its progress with the time left, and a button that cancels it."""
    job = jobs.running()
    if job is None:
        return
    row, left = header.layout.row(align=True), job.remaining
    text = f"{translated(job.title)}: {job.message}"
    if left is not None:
        text += translated(", about {seconds} s left", seconds=f"{left:.0f}")
    row.label(text=text, translate=False)
    row.progress(factor=job.fraction, text=f"{job.fraction:.0%}")  # too narrow for words
    row.operator(Op.CANCEL, icon="X")
