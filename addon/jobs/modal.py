# SPDX-License-Identifier: GPL-3.0-or-later
"""Modal operators with a timer, which run a job between the window's events."""

from ..blender.host import has_window
from ..blender.language import translated
from ..blender.scene_reference import SceneReference
from ..core.errors import UserError
from ..core.runtime import jobs
from ..core.runtime.coroutines import step_for
from .display import display


class Runs(set):
    """Coroutines of the running modal operators."""

    def clear(self):
        """Ends them while their operators are there: Blender drops these with their class, unasked."""
        while self:
            self.pop().close()


runs = Runs()


class ModalRun:
    """Mixin of operators with a `coroutine(context)` of what the main thread does for a job."""

    in_window = False  # whether it runs beside the window's events

    def invoke(self, context, event):
        if not has_window() or context.window is None:
            return self.execute(context)
        self.set_out(context)
        result = self.advance(context)
        if result == {"RUNNING_MODAL"}:  # what ends at once is freed, with a handler of it left
            context.window_manager.modal_handler_add(self)
        return result

    def set_out(self, context):
        self.in_window, self._coroutine = True, self.coroutine(context)
        self._scene = SceneReference(context)
        runs.add(self._coroutine)
        display.begin(context)

    def modal(self, context, event):
        job = jobs.running()
        if job is None:  # stopped from outside: a file is loaded, a step undone, the add-on disabled
            self.leave()
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            job.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        return self.advance(context)

    def advance(self, context):
        """Does a slice of the main thread's work, and shows how far the job is."""
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
        """Whether the main thread's work has to wait until the window shows the job's own scene again."""
        job = jobs.running()
        if job is None or job.cancelled:
            return False
        name = self._scene.missed(context)
        job.waiting = name and translated("Waits until the window shows {name}", name=name)
        return bool(name)

    def show_progress(self, context, job):
        display.show(context, job)

    def cancel(self, context):
        """Blender ends the operator: its window closes or a file is loaded."""
        self.leave()

    def leave(self):
        runs.discard(self._coroutine)
        self._coroutine.close()
        jobs.stop()
        display.clear()
