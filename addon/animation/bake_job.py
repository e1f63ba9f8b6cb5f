# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes of several objects in one pass: the main thread plays the scene, a worker solves."""

import contextlib

from ..blender.host import has_window
from ..blender.language import about, translated
from ..blender.object_references import ObjectReference, settings_of
from ..blender.property_definitions import effective_value, flag
from ..core.errors import UserError
from ..core.runtime.jobs import Item, JobCancelled, Pause
from ..field_modifier import layers
from ..handles import empties
from ..jobs.job_operator import JobOperator, with_progress
from ..solver import style_settings
from ..wrap import landmarks
from . import frames, object_bake
from .frames import FrameFeed, playing

# Bakes of several objects in one pass over the frames: the main thread plays the scene and reads requests,
# the worker solves them and writes the shapes. Few requests are in memory at once.

AHEAD = 8  # most frames read ahead of the worker, if each request has point positions of its own


class BakePass:
    """The bakes (object_bake.ObjectBake), all of the same frames.

    Requests with handles only are small: all frames are then played at once, and the scene is back at its
    frame while the worker solves.
    """

    def __init__(self, bakes, frames):
        self.bakes, self.frames, self.failed = bakes, frames, []
        starts = [bake.simulation.start for bake in bakes if bake.simulation is not None]
        self.played = frames.with_those_before(min(starts)) if starts else list(frames)
        moving = any(bake.reader.moves_by_itself or bake.reader.carrying.objects for bake in bakes)
        self.feed = FrameFeed(AHEAD if moving else len(self.played))

    def item(self, context, job, failures):
        names = ", ".join(bake.name for bake in self.bakes)
        return Item(names, self.work, lambda _: self.place(context, job, failures))

    def play(self, context, job):
        """Coroutine that plays the frames and queues the requests of each; restores the frame at the end."""
        with contextlib.closing(self.feed), playing(context.scene) as show:
            for frame in self.played:
                while self.feed.is_full and not job.done:
                    yield Pause.WORKER
                if job.done:  # cancelled, or every object failed
                    return
                show(frame)
                self.feed.put([bake.request(context) for bake in self.bakes])
                yield Pause.REDRAW

    def work(self, tracker):
        """Solves and stores all frames; on the worker."""
        count, baked = len(self.played), set(self.frames)
        try:
            for bake in self.bakes:
                bake.attempt(bake.prepare)
            for number, frame in enumerate(self.played):
                text = translated("frame {frame}", frame=f"{frame:g}")
                task = tracker.start(text, 1 / (count - number))
                requests = self.feed.take(task)
                for bake, request in zip(self.bakes, requests, strict=True):
                    if task.cancelled:
                        raise JobCancelled
                    bake.attempt(bake.add, frame, request, frame in baked, task)
                if all(bake.error is not None for bake in self.bakes):
                    break
            for bake in self.bakes:
                bake.attempt(bake.finish, task)
        except BaseException:
            self.discard()
            raise

    def place(self, context, job, failures):
        """Coroutine: once all bakes are ready, puts caches and keys in place; returns the line to report."""
        lines = []
        for bake in self.bakes:
            yield from self.unless_it_fails(bake, bake.ready(context, job), failures)
        for bake in self.bakes:
            line = yield from self.unless_it_fails(bake, bake.place(context), failures)
            if line is not None:
                lines.append(line)
                failures += [about(bake.name, reason) for reason in bake.carried.warnings]
        if not lines:
            raise UserError("{error}", error=failures.pop())
        return ", ".join(lines)

    def unless_it_fails(self, bake, coroutine, failures):
        """Coroutine: the result of `coroutine`; None if the bake has failed, which is reported once."""
        if bake not in self.failed:
            try:
                if bake.error is not None:
                    raise bake.error
                return (yield from coroutine)
            except (UserError, ValueError) as error:
                self.failed.append(bake)
                failures.append(about(bake.name, error))
        return None

    def discard(self):
        """Removes caches that are not in place."""
        for bake in self.bakes:
            bake.discard()

    def discard_keys(self):
        """Removes shape keys that are not in place; on the main thread."""
        for bake in self.bakes:
            bake.store.discard_item()


# Base of the bake and export operators: the scene plays on the main thread while a worker solves.

SETTINGS = ("format", "splat_format", "kind", "range", "step", "subframes", "loop")


class BakeOperator(JobOperator):
    """Mixin of operators that play the scene while a worker solves its frames.

    A subclass has `places(context)`: {path of a file to write: whether that file is the object's own}.
    """

    overwrite: flag("Overwrite", "Replace a file without a question", options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def refuses(cls, source):
        return refusal_of(source, effective_kind(source))

    frames_pass = None  # BakePass, if frames are solved
    covered = ()  # ObjectReferences of sources whose earlier results became layers
    used = SETTINGS

    def invoke(self, context, event):
        taken = []
        if has_window() and not self.overwrite:
            with contextlib.suppress(UserError, OSError):  # the job reports it
                taken = [path for path, own in self.places(context).items() if path.exists() and not own]
        if not taken:
            return super().invoke(context, event)
        ask(context, self, taken)
        return {"CANCELLED"}

    def prepare(self, context, job):
        """Coroutine: the job's items by `plan_frames(context, job)`; an error goes to `failures`."""
        try:
            return (yield from self.plan_frames(context, job))
        except (UserError, ValueError, OSError) as error:
            self.failures.append(translated(error))
            return []

    def work_beside(self, context, job):
        if self.frames_pass is not None:
            yield from self.frames_pass.play(context, job)

    def clear_up(self, job):
        for source in filter(None, (reference.find() for reference in self.covered)):
            layers.uncover(source)  # unless a cache plays
        if self.frames_pass is not None:
            self.frames_pass.feed.close()
            job.cancel()
            job.join()
            self.frames_pass.discard()
            self.frames_pass.discard_keys()

    def values(self, source):
        """The settings by name; `start` and `end` only if given, or if the range is CUSTOM."""
        group = settings_of(source).bake
        values = {name: effective_value(name, group, self) for name in self.used}
        for name in ("start", "end"):
            given = self.properties.is_property_set(name)
            if given or values["range"] == "CUSTOM":
                values[name] = effective_value(name, group, self)
        return values

    def choose(self, context, sources, values):
        """The Frames to bake."""
        return frames.choose(context, sources, values)

    def begin(self, context, job, sources, values, bakes_of):
        """Coroutine: reads the sources, (object, kind), each as an ObjectBake by `bakes_of(source, kind,
        frames)`; returns the job's items."""
        chosen, bakes, self.covered = self.choose(context, sources, values), [], []
        for source, kind in sources:
            reason = refusal_of(source, kind)
            try:
                if reason is not None:
                    raise reason
                if kind == "DEFORM" and layers.make_way(source, kind).is_covered:
                    self.covered.append(ObjectReference(source))
                bake = bakes_of(source, kind, chosen)
                yield from with_progress(job, bake.reader.read_setup(context), source.name)
                bakes.append(bake)
            except (UserError, ValueError, OSError) as error:
                self.failures.append(about(source.name, error))
        if not bakes:
            return []
        self.frames_pass = BakePass(bakes, chosen)
        return [self.frames_pass.item(context, job, self.failures)]


def ask(context, operator, paths):
    """Pops up a menu whose button runs the operator again with the same arguments and `overwrite`."""
    given = arguments(operator) | {"overwrite": True}
    names = ", ".join(path.name for path in paths)

    def draw(menu, _):
        menu.layout.operator_context = "INVOKE_DEFAULT"
        button = menu.layout.operator(operator.bl_idname, text="Overwrite", icon="ERROR")
        for name, value in given.items():
            setattr(button, name, value)

    title = translated("{names} exists already", names=names)
    context.window_manager.popup_menu(draw, title=title, icon="QUESTION")


def arguments(operator):
    """{name: value} of the arguments that an operator was given."""
    chosen, own = operator.properties, operator.properties.bl_rna.properties
    own = [one.identifier for one in own if not one.is_readonly and chosen.is_property_set(one.identifier)]
    return {name: getattr(chosen, name) for name in own}


def effective_kind(source, operator=None):
    return object_bake.kind_of(source, effective_value("kind", settings_of(source).bake, operator))


def refusal_of(source, kind):
    """UserError that says why a source has nothing to bake; else None."""
    if kind == "WRAP":
        return None if settings_of(source).wrap.frames else landmarks.refusal(source)
    return empties.require_handles(source) if kind == "DEFORM" else style_settings.refusal(source)
