# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that run a job: at once and blocking from scripts, modal with progress in a window."""

import contextlib
import sys
import time
import types

import bpy

from ..core import jobs, native
from ..core.errors import UserError
from ..core.stages import JobCancelled
from . import handles, lookup, preview
from .language import translated

TICK = 0.1  # seconds between looks at the worker
BUDGET = 0.02  # seconds that the main thread works at once


SCOPES = (
    ("ACTIVE", "Active", "The active object alone"),
    ("SELECTED", "Selected", "Every selected mesh object, one after another"),
    ("COLLECTION", "Collection", "Every mesh object of the active object's collections"),
)


class JobOperator:
    """Mixin of operators whose work runs on the worker thread.

    A subclass has `title` and `plan(context, source)`, which reads what the worker needs and returns a
    jobs.Item; its `apply` runs on the main thread and returns the line to report.
    """

    title = ""
    needs_handles = False  # whether it is refused without one
    has_window = False  # whether it runs beside the window's events

    scope: bpy.props.EnumProperty(
        items=SCOPES, name="Objects", description="Which objects to work on", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        source = lookup.source_of(context)
        reason = native.problem() or lookup.refusal(source) or busy()
        if not reason and cls.needs_handles and not handles.used(source):
            reason = UserError("Add a handle first")
        if reason:
            cls.poll_message_set(translated(reason))
        return not reason

    def sources(self, context):
        """The objects to work on; none is ignored silently, what cannot be worked on becomes a failure."""
        if self.scope == "ACTIVE":
            return [lookup.source_of(context)]
        active = lookup.source_of(context)
        within = context.selected_objects
        if self.scope == "COLLECTION":
            within = [item for home in active.users_collection for item in home.all_objects]
        meshes = [item for item in within if item.type == "MESH"]
        owners = [lookup.settings_of(item).result_of or item for item in meshes]
        found = list(dict.fromkeys(owners))
        self.failures += [translated(lookup.refusal(item)) for item in found if lookup.refusal(item)]
        return [item for item in found if not lookup.refusal(item)]

    def prepare(self, context):
        """The job for all sources; what cannot be planned is kept as a failure of its own."""
        self.failures, self.successes = [], []
        items = []
        for source in self.sources(context):
            try:
                items.append(self.plan(context, source))
            except (UserError, ValueError) as error:
                self.failures.append(translated(error))
        return jobs.Job(self.title, items, native.library().Task)

    def course(self, context):
        """All that the main thread does, as a generator: yields True to wait for the worker, False when the
        window may redraw. Returns the operator's result."""
        job = self.prepare(context)
        jobs.begin(job)
        while not job.done:
            yield True
        return (yield from self.conclude(context, job))

    def execute(self, context):
        course = self.course(context)
        try:
            while True:
                if next(course):
                    jobs.running().join(0.05)
        except StopIteration as ended:
            return ended.value
        except KeyboardInterrupt:
            course.close()
            return {"CANCELLED"}
        finally:
            jobs.stop()

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self.has_window, self._looks = True, 0
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
        until = time.monotonic() + BUDGET
        try:
            while not next(self._course) and time.monotonic() < until:
                pass
        except StopIteration as ended:
            self.leave(context)
            return ended.value
        except Exception:
            self.leave(context)
            raise
        self.show_progress(context, jobs.running())
        return {"RUNNING_MODAL"}

    def show_progress(self, context, job):
        item, looks, points = job.sight()
        if looks and looks != self._looks and item.preview is not None:
            item.preview.show(points)
            redraw(context, "WINDOW")
        self._looks = looks
        redraw(context, "UI")
        context.workspace.status_text_set(f"{job.message}  {job.fraction:.0%}  {translated('(ESC cancels)')}")

    def cancel(self, context):
        """Blender ends the operator: its window closes or a file is loaded."""
        self.leave(context)

    def leave(self, context):
        self._course.close()
        jobs.stop()
        preview.clear()
        context.window_manager.event_timer_remove(self._timer)
        if context.workspace:
            context.workspace.status_text_set(None)
        redraw(context, "UI", "WINDOW")

    def conclude(self, context, job):
        """Applies what the worker made, reports it, and returns the operator's result."""
        cancelled = job.cancelled and not job.items
        for outcome in job.take_outcomes():
            if outcome.cancelled:
                cancelled = True
            elif outcome.error:
                self.failures.append(f"{outcome.item.label}: {translated(outcome.error)}")
            else:
                cancelled |= yield from self.apply_one(outcome)
        if cancelled and not self.successes and not self.failures:
            self.note("INFO", translated("{job} cancelled", job=translated(self.title)))
            return {"CANCELLED"}
        for text in self.successes:
            self.note("INFO", text)
        for text in self.failures:
            self.note("ERROR" if not self.successes else "WARNING", text)
        return {"FINISHED"} if self.successes else {"CANCELLED"}

    def apply_one(self, outcome):
        """Puts one item's result into the scene; returns whether the user cancelled meanwhile."""
        try:
            text = outcome.item.apply(outcome.value)
            if isinstance(text, types.GeneratorType):
                text = yield from text
            took = translated("in {seconds} s", seconds=f"{outcome.seconds:.1f}")
            self.successes.append(f"{outcome.item.label}: {text} {took}")
        except UserError as error:
            self.failures.append(translated(error))
        except JobCancelled:
            return True
        return False

    def note(self, level, text):
        jobs.note(level, text)
        self.report({level}, text)


def busy():
    """Why nothing can be started while a job runs; None when none does."""
    return UserError("Wait for the running job, or cancel it") if jobs.running() else None


def redraw(context, *kinds):
    """Has regions of these kinds of every 3D view drawn again."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type in kinds:
                        region.tag_redraw()


@bpy.app.handlers.persistent
def stop(*_):
    """The file is about to change under the job: another is loaded, or a step undone."""
    jobs.stop()


HANDLERS = ("load_pre", "undo_pre", "redo_pre")


def register():
    for name in HANDLERS:
        getattr(bpy.app.handlers, name).append(stop)


def unregister():
    jobs.stop()
    for name in HANDLERS:
        with contextlib.suppress(ValueError):
            getattr(bpy.app.handlers, name).remove(stop)
    sys.stdout.flush()
