# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that run a job: at once and blocking from scripts, modal with progress in a window."""

import contextlib
import sys

import bpy

from ..core import jobs, native
from ..core.errors import UserError
from . import lookup

TICK = 0.1  # seconds between looks at the worker


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

    scope: bpy.props.EnumProperty(
        items=SCOPES, name="Objects", description="Which objects to work on", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        reason = native.problem() or lookup.refusal(lookup.source_of(context))
        reason = reason or ("Wait for the running job, or cancel it" if jobs.running() else "")
        if reason:
            cls.poll_message_set(reason)
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
        self.failures += [lookup.refusal(item) for item in found if lookup.refusal(item)]
        return [item for item in found if not lookup.refusal(item)]

    def prepare(self, context):
        """The job for all sources; what cannot be planned is kept as a failure of its own."""
        self.failures, self.successes = [], []
        items = []
        for source in self.sources(context):
            try:
                items.append(self.plan(context, source))
            except (UserError, ValueError) as error:
                self.failures.append(str(error))
        return jobs.Job(self.title, items, native.library().Task)

    def execute(self, context):
        try:
            job = self.prepare(context)
            jobs.begin(job)
            try:
                while not job.join(0.05):
                    pass
            except KeyboardInterrupt:
                job.cancel()
                job.join()
            return self.conclude(context, job)
        finally:
            jobs.end()

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        job = self.prepare(context)
        jobs.begin(job)
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        job = jobs.running()
        if job is None:  # stopped from outside: a file is loaded, the add-on disabled
            self.stop_timer(context)
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            job.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        redraw(context)
        context.workspace.status_text_set(f"{job.message}  {job.fraction:.0%}  (ESC cancels)")
        if not job.done:
            return {"PASS_THROUGH"}
        self.stop_timer(context)
        try:
            return self.conclude(context, job)
        finally:
            jobs.end()
            redraw(context)

    def cancel(self, context):
        """Blender ends the operator: its window closes or a file is loaded."""
        jobs.stop()
        self.stop_timer(context)

    def stop_timer(self, context):
        context.window_manager.event_timer_remove(self._timer)
        if context.workspace:
            context.workspace.status_text_set(None)

    def conclude(self, context, job):
        """Applies what the worker made, reports it, and ends the operator."""
        cancelled = False
        for outcome in job.take_outcomes():
            if outcome.cancelled:
                cancelled = True
            elif outcome.error:
                self.failures.append(f"{outcome.item.label}: {outcome.error}")
            else:
                self.apply_one(context, outcome)
        if cancelled and not self.successes and not self.failures:
            jobs.note("INFO", f"{self.title} cancelled")
            self.report({"INFO"}, f"{self.title} cancelled")
            return {"CANCELLED"}
        for text in self.successes:
            self.note("INFO", text)
        for text in self.failures:
            self.note("ERROR" if not self.successes else "WARNING", text)
        return {"FINISHED"} if self.successes else {"CANCELLED"}

    def apply_one(self, context, outcome):
        try:
            text = outcome.item.apply(outcome.value)
            self.successes.append(f"{outcome.item.label}: {text} in {outcome.seconds:.1f} s")
        except UserError as error:
            self.failures.append(str(error))

    def note(self, level, text):
        jobs.note(level, text)
        self.report({level}, text)


def redraw(context):
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


@bpy.app.handlers.persistent
def before_load(*_):
    jobs.stop()


def register():
    bpy.app.handlers.load_pre.append(before_load)


def unregister():
    jobs.stop()
    with contextlib.suppress(ValueError):
        bpy.app.handlers.load_pre.remove(before_load)
    sys.stdout.flush()
