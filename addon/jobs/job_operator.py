# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that run a job: at once and blocking from scripts, modal with progress in a window."""

import contextlib
import sys
import types

import bpy

from ..blender import object_references, vertex_groups
from ..blender.language import translated
from ..core.errors import UserError
from ..core.runtime import jobs, native
from ..core.runtime.progress import JobCancelled
from ..handles import empties
from .modal import ModalRun

SCOPES = (
    ("ACTIVE", "Active", "The active object alone"),
    ("SELECTED", "Selected", "Every selected mesh object, one after another"),
    ("COLLECTION", "Collection", "Every mesh object of the active object's collections"),
)


class JobOperator(ModalRun):
    """Mixin of operators whose work runs on the worker thread.

    A subclass has `title` and `plan(context, source, weights)`, which reads what the worker needs and returns
    a jobs.Item; its `apply` runs on the main thread and returns the line to report. `weights` are those of
    the vertex groups that it names by `groups_of(source)`.
    """

    title = ""
    needs_handles = False  # whether it is refused without one

    scope: bpy.props.EnumProperty(
        items=SCOPES, name="Objects", description="Which objects to work on", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        source = object_references.source_of(context)
        reason = native.problem() or object_references.refusal(source) or busy()
        if not reason and cls.needs_handles and not empties.used(source):
            reason = UserError("Add a handle first")
        if reason:
            cls.poll_message_set(translated(reason))
        return not reason

    def sources(self, context):
        """The objects to work on; none is ignored silently, what cannot be worked on becomes a failure."""
        if self.scope == "ACTIVE":
            return [object_references.source_of(context)]
        active = object_references.source_of(context)
        within = context.selected_objects
        if self.scope == "COLLECTION":
            within = [item for home in active.users_collection for item in home.all_objects]
        meshes = [item for item in within if item.type == "MESH"]
        owners = [object_references.settings_of(item).result_of or item for item in meshes]
        found = list(dict.fromkeys(owners))
        self.failures += [
            translated(object_references.refusal(item)) for item in found if object_references.refusal(item)
        ]
        return [item for item in found if not object_references.refusal(item)]

    def groups_of(self, source):
        """Names of the vertex groups whose weights the plan needs."""
        return []

    def prepare(self, context, job):
        """Course that reads all sources, and their items; what cannot be planned is kept as a failure."""
        items = []
        for who in [object_references.ObjectId(source) for source in self.sources(context)]:
            try:
                source = who.get()
                reading = vertex_groups.read_weights(context, source, self.groups_of(source))
                weights = yield from watched(job, reading, who.name)
                items.append(self.plan(context, who.get(), weights))
            except (UserError, ValueError) as error:
                self.failures.append(translated(error))
            yield False
        return items

    def course(self, context):
        """All that the main thread does, as a generator: yields True to wait for the worker, False when the
        window may redraw. Returns the operator's result."""
        self.failures, self.successes = [], []
        job = jobs.Job(self.title, [], native.library().Task, stands_back=self.has_window)
        jobs.begin(job, start=False)
        try:
            items = yield from self.prepare(context, job)
        except JobCancelled:
            self.note("INFO", translated("{job} cancelled", job=translated(self.title)))
            return {"CANCELLED"}
        job.start(items)
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


def watched(job, course, label):
    """The same course, which shows what is read and can be cancelled."""
    while True:
        job.outside(0.0, translated("Reading {name}", name=label))
        try:
            yield next(course)
        except StopIteration as ended:
            return ended.value


def busy():
    """Why nothing can be started while a job runs; None when none does."""
    return UserError("Wait for the running job, or cancel it") if jobs.running() else None


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
