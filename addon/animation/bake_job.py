# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes of objects, or of a wrap onto a sequence: the main thread plays the scene, a worker solves."""

import contextlib
import functools
import math
import re
from pathlib import Path
from types import SimpleNamespace

import bpy

from ..blender import modifier_stack
from ..blender.evaluation import depsgraph_of, world_matrix
from ..blender.host import has_window
from ..blender.language import about, translated
from ..blender.object_references import ObjectReference, owner_of, settings_of
from ..blender.property_definitions import effective_value, effective_values, flag, options_of
from ..core.errors import UserError
from ..core.geometry.spaces import space_of
from ..core.runtime import native
from ..core.runtime.jobs import Item, JobCancelled, Pause
from ..core.settings.parameters import WRAP
from ..deform.solve_job import describe
from ..field_modifier import layers
from ..handles import empties
from ..jobs.job_operator import JobOperator, with_progress
from ..solver import frame_range, style_settings
from ..solver.frame_range import FrameFeed, Frames, playing
from ..solver.frame_solver import FrameSolver, Request, flat, sampled
from ..wrap import landmarks
from . import object_bake
from .caches import file_name, plain
from .object_bake import ObjectBake

# Bakes of several objects in one pass: the main thread plays the scene, a worker solves.

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
        return frame_range.choose_frames(context, sources, values)

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
        self.frames_pass, self.worked_on = BakePass(bakes, chosen), [bake.reference for bake in bakes]
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


# Bakes a template that follows a scanned motion: a wrap per frame, each starting from the last one.


def scans_in(collection, scene, sources, values):
    """{frame: ObjectReference} of a collection's meshes, in the order of their names.

    The last number in a name is its frame, if at least half of these frames have a mesh; else the meshes are
    numbered from the scene's first frame. `values` may limit the frames by `start` and `end`.
    """
    native.library()
    from arapfields.cli.wrapping import by_numbers

    meshes = [one for one in collection.all_objects if one.type == "MESH" and one not in sources]
    meshes = [mesh for mesh in meshes if owner_of(mesh) not in sources]
    meshes.sort(key=lambda mesh: by_numbers(mesh.name))
    numbers = [int(number) for mesh in meshes for number in re.findall(r"\d+", mesh.name)[-1:]]
    if len(set(numbers)) < len(meshes) or (numbers and frames_of(numbers).count > 2 * len(meshes)):
        numbers = range(scene.frame_start, scene.frame_start + len(meshes))
    first, last = values.get("start", -math.inf), values.get("end", math.inf)
    pairs = zip(numbers, meshes, strict=True)
    scans = {frame: ObjectReference(mesh) for frame, mesh in pairs if first <= frame <= last}
    if not scans:
        raise UserError("{name} has no mesh for these frames", collection)
    return scans


def frames_of(numbers):
    """The Frames with the largest step that contain all of these whole numbers."""
    numbers = sorted(numbers)
    step = math.gcd(*(number - numbers[0] for number in numbers)) or 1
    return Frames(float(numbers[0]), float(step), (numbers[-1] - numbers[0]) // step + 1)


def put_after_armatures(item):
    """Moves the cache's modifier after Armature modifiers, as a scan is posed already."""
    stack, cache = list(item.modifiers), modifier_stack.find_cache(item)
    if cache is None:
        return
    first = stack.index(cache)
    last = max((k for k, one in enumerate(stack) if one.type == "ARMATURE"), default=first)
    if last > first and all(map(modifier_stack.kind_keeps_vertices, stack[first:last])):
        item.modifiers.move(first, last)


def scan_at(frame, scans):
    scan = scans[frame].find() if frame in scans else None
    if scan is None:
        raise UserError("There is no mesh")
    return scan


def off(report):
    """The larger of the mean distances between surface and scan, as a share of the scan's size."""
    return max(report.to_target_mean, report.from_target_mean)


class WrapSolver(FrameSolver):
    """FrameSolver of wraps: a request's targets are a scan's vertices and triangles, its handles landmarks.
    Each solve starts from the last shape."""

    def __init__(self, sampled_source, carrying, frames):
        self.frames, self.report = frames, None
        super().__init__(sampled_source, carrying)

    def _make_solver(self, handles, energy):
        """Does nothing: a wrap has no native solver before its first frame."""

    def solve_from_rest(self, request, task=None):
        field, self.report = self.frames.follow(
            b"".join(flat(request.targets)),
            lambda: native.library().MeshSdf(*request.targets),
            request.handles,
            lambda call: call(task),
        )
        self.solver = SimpleNamespace(field=field)
        return self.exact_shape(request)


class WrapBake(ObjectBake):
    """`scans`: {frame: ObjectReference}; None if the source's own target is animated. Solved frames are
    stored beside the cache; for shape keys, in Blender's temporary folder."""

    def __init__(self, context, source, frames, scans, path=None):
        super().__init__(context, source, "WRAP", frames, path)
        self.scans, self.simulation = scans, None
        self.reader.carrying.is_shown_posed = True  # caches play after the armatures
        self.reader.moves_by_itself = True  # limits read-ahead: scans need much memory
        self.marks = landmarks.Marks(source)
        self.values = effective_values(WRAP, settings_of(source).wrap)
        self.reports, self.left_out = {}, {}  # by frame; {error: its frames}
        self.output = path or Path(bpy.app.tempdir, file_name(source, context.scene, Path(bpy.app.tempdir)))

    def request(self, context):
        try:
            source, frame = self.reference.get(), context.scene.frame_current
            space = space_of(world_matrix(source), source.name)
            scan = landmarks.target_of(source) if self.scans is None else scan_at(frame, self.scans)
            self.reader.carrying.expect_motion()
            self.reader.refresh_carried(context)
            carried = self.reader.carrying.poses(space, depsgraph_of(context))
            mesh = landmarks.read_target(context, scan, space)
            marks = landmarks.read(source, space)
            return Request([*mesh], None, self.reader.points, marks, {}, carried, None)
        except (UserError, ValueError) as error:
            return error

    def prepare(self):
        from arapfields.cli.frames import HeldFrames, WrappedFrames, folder_beside

        setup = sampled(self.reader.setup, self.values["samples"], self.values["seed"])
        options = options_of("wrap", self.values)
        self.wrapped = WrappedFrames(folder_beside(self.output), setup.samples, options)
        self.held = HeldFrames(self.keep)
        self.solver = WrapSolver(setup, self.reader.carrying, self.wrapped)
        self.carried.prepare()
        self.store.open(self.solver)

    def add(self, frame, request, is_baked=True, task=None):
        """Solves one frame; one that fails is reported, and gets the last shape, or else the first one."""
        shape = None
        try:
            if isinstance(request, Exception):
                raise request
            shape = self.solver.solve_from_rest(request, task)
            self.reports[frame] = self.solver.report
        except (UserError, ValueError, native.library().Diverged) as error:
            self.left_out.setdefault(translated(error), (error, []))[1].append(str(plain(frame)))
        self.held.add(shape)

    def finish(self, task):
        named = [{"frame": ", ".join(frames), "error": error} for error, frames in self.left_out.values()]
        if not self.reports:
            told = [UserError("Frame {frame}: {error}", **one) for one in named]
            raise functools.reduce(lambda a, b: UserError("{first}; {second}", first=a, second=b), told)
        first = next(iter(self.reports.values()))
        self.marks.left_out = first.left_out
        notes = [UserError("note: {text}", text=self.marks.numbered(note)) for note in first.notes]
        self.carried.warnings += notes + [UserError("Frame {frame}: {error}; held", **one) for one in named]
        self.wrapped.forget_others()
        super().finish(task)

    def place(self, context):
        line = yield from super().place(context)
        self.marks.put()
        source = self.reference.get()
        for item in (source, *(carried.reference.find() for carried in self.carried.carrying.objects)):
            if item is not None and item.type == "MESH":
                put_after_armatures(item)
        frame, report = max(self.reports.items(), key=lambda one: off(one[1]))
        worst = {"frame": plain(frame), "figures": describe("", report.to_dict(), 1.0)}
        parts = [line, translated("at worst, in frame {frame}: {figures}", **worst)]
        if self.wrapped.found:
            parts.append(translated("{count} frames were there already", count=self.wrapped.found))
        return "; ".join(parts)
