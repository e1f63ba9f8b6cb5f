# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import modifier_stack
from ..blender.guide import Guided
from ..blender.language import translated
from ..blender.object_references import refusal, settings_of, source_of
from ..blender.property_definitions import effective_value
from ..core.errors import UserError
from ..core.runtime import jobs, native
from ..core.runtime.coroutines import Pause
from ..core.runtime.progress import JobCancelled
from ..field_modifier import cache_modifier
from ..handles import empties
from ..jobs.job_operator import JobOperator, with_progress
from ..names import Op
from ..stylize import preference
from . import frames, object_bake
from .bake_job import BakePass
from .object_bake import ObjectBake
from .properties import folder, settings

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
                yield from with_progress(job, bake.session.reading, source.name)
                bakes.append(bake)
            except (UserError, ValueError, OSError) as error:
                text = translated(error)
                self.failures.append(text if source.name in text else f"{source.name}: {text}")
        if not bakes:
            return []
        self.passed = BakePass(bakes, found)
        return [self.passed.item(context, job, self.failures)]


class ARAPFIELDS_OT_bake(BakeOperator, bpy.types.Operator):
    """Solve the frames of an animation and keep them, so that they play anywhere, without this extension"""

    bl_idname = Op.BAKE
    bl_label = "Bake Animation"
    bl_options = {"UNDO"}
    title = "Bake"
    guide = "animation"

    __annotations__ = {
        **settings(options={"SKIP_SAVE"}),
        "folder": folder(options={"SKIP_SAVE"}),
        "filepath": bpy.props.StringProperty(
            name="File",
            description="Where one object's cache goes; empty for a file with its name in the folder",
            subtype="FILE_PATH",
            options={"SKIP_SAVE"},
        ),
    }

    def prepare(self, context, job):
        try:
            active = source_of(context)
            sources = [(source, effective_kind(source, self)) for source in self.sources(context)]
            if self.filepath and len(sources) > 1:
                raise UserError("one file cannot take several objects; choose a folder")
            values = self.values(active)

            def make(source, kind, found):
                suffix = object_bake.SUFFIXES.get(values["format"])
                where = ()
                if suffix is not None:
                    place = effective_value("folder", settings_of(active).bake, self)
                    where = object_bake.cache_path(source, suffix, place, self.filepath)
                bake = ObjectBake(context, source, kind, found, *where)
                self.warn_of_weight(bake)
                return bake

            return (yield from self.begin(context, job, sources, values, make))
        except (UserError, ValueError, OSError) as error:
            self.failures.append(translated(error))
            return []

    def warn_of_weight(self, bake):
        weight = object_bake.keys_weight(len(bake.session.surface.local), bake.frames.count)
        if bake.path is None and weight > object_bake.HEAVY:
            told = translated(
                "shape keys of {size} in the .blend and in memory; a cache would take neither",
                size=object_bake.size_text(weight),
            )
            self.warnings.append(f"{bake.name}: {told}")


class ARAPFIELDS_OT_remove_bake(Guided, bpy.types.Operator):
    """Take the modifier that plays the bake away; the cache's file stays"""

    bl_idname = Op.REMOVE_BAKE
    bl_label = "Remove Bake"
    bl_options = {"REGISTER", "UNDO"}
    guide = "animation"

    @classmethod
    def poll(cls, context):
        source = source_of(context)
        reason = refusal(source)
        if reason is None and modifier_stack.find_cache(source) is None:
            reason = UserError("{name} plays no bake", name=source.name)
        if reason:
            cls.poll_message_set(translated(reason))
        return not reason

    def execute(self, context):
        cache_modifier.remove(source_of(context))
        return {"FINISHED"}


def effective_kind(source, operator=None):
    group = settings_of(source).bake
    return object_bake.kind_of(
        source, group.kind if operator is None else effective_value("kind", group, operator)
    )


def refusal_of(source, kind):
    """Why there is nothing to bake of a source, as a UserError; None where there is."""
    return empties.require_handles(source) if kind == "DEFORM" else preference.refusal(source)


CLASSES = [ARAPFIELDS_OT_bake, ARAPFIELDS_OT_remove_bake]
