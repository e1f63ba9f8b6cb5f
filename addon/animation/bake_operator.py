# SPDX-License-Identifier: GPL-3.0-or-later
"""What baking and exporting share: the scene plays on the main thread while a worker solves."""

from ..blender.language import translated
from ..blender.object_references import settings_of
from ..blender.property_definitions import effective_value
from ..core.errors import UserError
from ..core.runtime import jobs, native
from ..core.runtime.coroutines import Pause
from ..core.runtime.progress import JobCancelled
from ..handles import empties
from ..jobs.job_operator import JobOperator, with_progress
from ..solver import style_settings
from . import frames, object_bake
from .bake_job import BakePass

SETTINGS = ("format", "kind", "range", "step", "subframes")


class BakeOperator(JobOperator):
    """Mixin of operators that solve frames, and play the scene while a worker does."""

    @classmethod
    def refuses(cls, source):
        return refusal_of(source, effective_kind(source))

    def coroutine(self, context):
        """All that the main thread does; returns the operator's result."""
        self.failures, self.warnings, self.successes, self.passed = [], [], [], None
        job = jobs.Job(self.title, [], native.library().Task, low_priority=self.in_window)
        jobs.begin(job, start=False)
        try:
            try:
                items = yield from self.prepare(context, job)
                job.start(items)
                if self.passed is not None:
                    yield from self.passed.play(context, job)
            except JobCancelled:
                self.add_message("INFO", translated("{job} cancelled", job=translated(self.title)))
                return {"CANCELLED"}
            while not job.done:
                yield Pause.WORKER
            return (yield from self.conclude(context, job))
        finally:
            if self.passed is not None:
                self.passed.feed.close()
                job.cancel()
                job.join()
                self.passed.discard()

    def values(self, source):
        """The settings by name; `start` and `end` where they were given or the range is one's own."""
        group = settings_of(source).bake
        values = {name: effective_value(name, group, self) for name in SETTINGS}
        for name in ("start", "end"):
            given = self.properties.is_property_set(name)
            if given or values["range"] == "CUSTOM":
                values[name] = effective_value(name, group, self)
        return values

    def begin(self, context, job, sources, values, bakes_of):
        """Coroutine: reads the sources, (object, kind), each made an ObjectBake by `bakes_of(source, kind,
        frames)`; the job's items."""
        found = frames.choose(context, sources, values)
        bakes = []
        for source, kind in sources:
            reason = refusal_of(source, kind)
            try:
                if reason is not None:
                    raise reason
                bake = bakes_of(source, kind, found)
                yield from with_progress(job, bake.reader.read_setup(context), source.name)
                bakes.append(bake)
            except (UserError, ValueError, OSError) as error:
                text = translated(error)
                self.failures.append(text if source.name in text else f"{source.name}: {text}")
        if not bakes:
            return []
        self.passed = BakePass(bakes, found)
        return [self.passed.item(context, job, self.failures)]


def effective_kind(source, operator=None):
    return object_bake.kind_of(source, effective_value("kind", settings_of(source).bake, operator))


def refusal_of(source, kind):
    """Why there is nothing to bake of a source, as a UserError; None where there is."""
    return empties.require_handles(source) if kind == "DEFORM" else style_settings.refusal(source)
