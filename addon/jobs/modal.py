# SPDX-License-Identifier: GPL-3.0-or-later
"""Modal operators that run a job by a timer, between the window's events."""

import bpy

from ..blender.host import has_window
from ..blender.language import translated
from ..blender.object_references import SceneReference
from ..core.errors import UserError
from ..core.runtime import jobs
from ..core.runtime.jobs import step_for
from .display import display


class Runs(set):
    """Coroutines of the running modal operators."""

    def clear(self):
        """Closes them before their operators' classes are unregistered, which frees the operators."""
        while self:
            self.pop().close()


runs = Runs()


def is_over_view(context, event):
    """Whether the mouse is over a 3D view, not over its sidebar or header, where Esc ends other things."""
    spot = event.mouse_x, event.mouse_y
    for area in context.window.screen.areas if context.window is not None else ():
        under = [region for region in area.regions if covers(region, spot)]
        if area.type == "VIEW_3D" and under:
            return all(region.type == "WINDOW" for region in under)
    return False


def covers(region, spot):
    """Whether a region contains that pixel of the window."""
    return 0 <= spot[0] - region.x < region.width and 0 <= spot[1] - region.y < region.height


class ModalRun:
    """Mixin of operators with `coroutine(context)`, a job's work on the main thread."""

    in_window = False  # whether it runs modally in a window

    def invoke(self, context, event):
        if not has_window() or context.window is None:
            return self.execute(context)
        self.set_out(context)
        result = self.advance(context)
        if result == {"RUNNING_MODAL"}:  # the handler of an ended operator would outlive it
            context.window_manager.modal_handler_add(self)
        return result

    def set_out(self, context):
        self.in_window, self._coroutine = True, self.coroutine(context)
        self._scene = SceneReference(context)
        runs.add(self._coroutine)
        display.begin(context)

    def modal(self, context, event):
        job = jobs.running()
        if job is None:  # stopped by a file load, an undo, or the add-on's disabling
            self.leave()
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS" and is_over_view(context, event):
            bpy.ops.arapfields.cancel("INVOKE_DEFAULT")
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        return self.advance(context)

    def advance(self, context):
        """Runs the coroutine for a while, and shows the job's progress."""
        display.note_arrival()
        try:
            finished = None if self.waits(context) else step_for(self._coroutine)
        except UserError as error:  # the scene was deleted
            self.leave()
            self.add_message("ERROR", translated(error))
            return {"CANCELLED"}
        except Exception:
            self.leave()
            raise
        if finished:
            self.leave()
            return finished.value
        self.show_progress(context, jobs.running())
        display.note_departure()
        return {"RUNNING_MODAL"}

    def waits(self, context):
        """Whether the window shows another scene than the job's, for which the coroutine waits."""
        job = jobs.running()
        if job is None or job.cancelled:
            return False
        name = self._scene.missed(context)
        job.waiting = name and translated("Waits until the window shows {name}", name=name)
        return bool(name)

    def show_progress(self, context, job):
        display.show(context, job)

    def cancel(self, context):
        """Called by Blender when the window closes or a file is loaded."""
        self.leave()

    def leave(self):
        runs.discard(self._coroutine)
        self._coroutine.close()
        jobs.stop()
        display.clear()
