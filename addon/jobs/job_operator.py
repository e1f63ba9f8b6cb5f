# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators with jobs: the modal run that drives a job, and what all of them share."""

import types

import bpy

from ..blender import mesh_arrays, references, vertex_groups
from ..blender.host import has_window
from ..blender.language import about, translated
from ..blender.object_references import (
    ObjectReference,
    SceneReference,
    active_uids,
    is_source,
    owner_of,
    refusal,
    source_of,
)
from ..blender.property_definitions import choice
from ..blender.source_operator import Guided
from ..core.errors import UserError
from ..core.runtime import jobs, native
from ..core.runtime.jobs import JobCancelled, Pause, run_to_completion, step_for
from ..core.settings.choices import SCOPES
from .display import display

# Modal operators that run a job by a timer, between the window's events.


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


# Operators that run a job: blocking from scripts, modal with progress in a window.


class JobOperator(ModalRun, Guided):
    """Mixin of operators whose work runs on the worker thread.

    A subclass has `title` and `plan(context, source, weights)`, which reads what the worker needs and returns
    a jobs.Item; its `apply` runs on the main thread and returns the line to report. `weights` are those of
    the vertex groups that it names by `groups_of(source)`.
    """

    title = ""
    worked_on = ()  # ObjectReferences; once all of these objects are deleted, the job ends
    ended_live = False  # whether the operator has ended live mode
    about = frozenset()  # session_uids of the objects that its messages concern

    scope: choice(SCOPES, "Objects", "Which objects to work on", options={"SKIP_SAVE"})

    @classmethod
    def obstacle(cls, context):
        source = source_of(context)
        return unready(source) or cls.refuses(source)

    @classmethod
    def refuses(cls, source):
        """UserError that says why this operator does not apply to a valid source; else None."""
        return None

    def sources(self, context):
        """The objects to process; objects that cannot be processed are listed in `failures`."""
        active = source_of(context)
        if self.scope == "ACTIVE":
            return [active]
        within = context.selected_objects
        if self.scope == "COLLECTION":
            within = [item for home in active.users_collection for item in home.all_objects]
        owners = dict.fromkeys(owner_of(item) or item for item in within if is_source(item))
        refusals = {item: refusal(item) for item in owners}
        self.failures += [translated(reason) for reason in refusals.values() if reason]
        return [item for item, reason in refusals.items() if not reason]

    def in_place(self, source):
        """Whether the mesh is read at the field modifier's place in the stack."""
        return False

    def groups_of(self, source):
        """Names of the vertex groups whose weights the plan needs."""
        return []

    def prepare(self, context, job):
        """Coroutine that reads all sources, and their items; errors in planning go to `failures`."""
        items, self.worked_on = [], [ObjectReference(source) for source in self.sources(context)]
        for reference in self.worked_on:
            try:
                source = reference.get()
                groups, in_place = self.groups_of(source), self.in_place(source)
                reading = vertex_groups.read_weights(context, source, groups, in_place)
                weights = yield from with_progress(job, reading, reference.name)
                items.append(self.plan(context, reference.get(), weights))
            except (UserError, ValueError) as error:
                self.failures.append(translated(error))
            yield Pause.REDRAW
        return items

    def coroutine(self, context):
        """Coroutine of the job's main-thread work; returns the operator's result."""
        self.failures, self.warnings, self.successes = [], [], []
        self.about = active_uids(context)
        self.referred = references.referred(bpy.data.objects)
        job = jobs.Job(self.title, [], native.library().Task, low_priority=self.in_window)
        jobs.begin(job, start=False)
        try:
            items = yield from self.prepare(context, job)
            self.about |= {one.uid for one in (*self.worked_on, *(o for item in items for o in item.edits))}
            job.start(items)
            yield from self.work_beside(context, job)
            while not job.done:
                if self.losses():
                    job.cancel()
                yield Pause.WORKER
            result = yield from self.conclude(context, job)
        except JobCancelled:
            self.add_message("INFO", translated("{job} cancelled", job=translated(self.title)))
            result = {"CANCELLED"}
        finally:
            self.clear_up(job)
        if result == {"CANCELLED"}:
            self.push_undo()
        return result

    def losses(self):
        """A UserError for each object that is worked on, if all of them are deleted; else []."""
        found = []
        for reference in self.worked_on:
            try:
                reference.get()
                return []
            except UserError as error:
                found.append(error)
        return found

    def work_beside(self, context, job):
        """Coroutine of main-thread work while the worker runs."""
        yield from ()

    def push_undo(self):
        """Pushes an undo step if a job that applied nothing has changed data: Blender pushes none for it."""
        if self.ended_live:
            references.push("Live")
        else:
            references.push_new(self.title, bpy.data.objects, self.referred)

    def clear_up(self, job):
        """Removes temporary data, however the job has ended."""

    def execute(self, context):
        coroutine = self.coroutine(context)
        try:
            return run_to_completion(coroutine, wait=lambda: jobs.running().join(0.05))
        except KeyboardInterrupt:
            coroutine.close()
            return {"CANCELLED"}
        finally:
            jobs.stop()

    def conclude(self, context, job):
        """Applies and reports the worker's outcomes, and returns the operator's result."""
        cancelled = job.cancelled and not job.items
        for outcome in job.take_outcomes():
            self.warnings += [about(outcome.item.label, text) for text in outcome.warnings]
            if outcome.cancelled:
                cancelled = True
            elif outcome.error:
                self.failures.append(about(outcome.item.label, outcome.error))
            else:
                cancelled |= yield from self.apply_one(job, outcome)
        if cancelled:
            self.failures += map(translated, self.losses())
        if cancelled and not self.successes and not self.failures:
            self.add_message("INFO", translated("{job} cancelled", job=translated(self.title)))
            return {"CANCELLED"}
        for text in self.successes:
            self.add_message("INFO", text)
        for text in self.warnings:
            self.add_message("WARNING", text)
        for text in self.failures:
            self.add_message("ERROR" if not self.successes else "WARNING", text)
        return {"FINISHED"} if self.successes else {"CANCELLED"}

    def apply_one(self, job, outcome):
        """Puts one item's result into the scene; returns whether the user cancelled meanwhile."""
        try:
            for reference in outcome.item.edits if self.in_window else ():
                yield from until_edit_mode_ends(job, reference)
            text = outcome.item.apply(outcome.value)
            if isinstance(text, types.GeneratorType):
                text = yield from text
            self.successes.append(f"{outcome.item.label}: {text}, {outcome.seconds:.1f} s")
        except (UserError, ValueError) as error:
            self.failures.append(translated(error))
        except JobCancelled:
            return True
        return False

    def add_message(self, level, text):
        jobs.add_message(level, text, self.about)
        self.report({level}, text)


def with_progress(job, coroutine, label):
    """Wraps a coroutine to report progress and to allow cancellation."""
    while True:
        job.report_main_thread(0.0, translated("Reading {name}", name=label))
        try:
            yield next(coroutine)
        except StopIteration as ended:
            return ended.value


def until_edit_mode_ends(job, reference):
    """Coroutine that waits while an object is in Edit Mode: leaving it overwrites the mesh."""
    while (item := reference.find()) is not None and item.mode == "EDIT":
        job.report_main_thread(1.0, translated("{name} is in Edit Mode; leave it first", name=item.name))
        yield Pause.WORKER


def unready(source):
    """UserError that says why no solve of a source can start now; else None."""
    return native.problem() or refusal(source) or busy() or mesh_arrays.refusal(source)


def busy():
    """UserError if a job is running; else None."""
    return UserError("Wait for the running job, or cancel it") if jobs.running() else None
