# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes a template that follows a scanned motion: a wrap per frame, each starting from the last one."""

import functools
import math
import re
from pathlib import Path
from types import SimpleNamespace

import bpy

from ..blender import modifier_stack
from ..blender.evaluation import depsgraph_of, world_matrix
from ..blender.language import translated
from ..blender.object_references import ObjectReference, owner_of, settings_of
from ..blender.property_definitions import effective_values, options_of
from ..core.errors import UserError
from ..core.geometry.spaces import space_of
from ..core.runtime import native
from ..core.settings.parameters import WRAP
from ..deform.solve_job import describe
from ..solver.frame_solver import FrameSolver
from ..solver.request import Request, flat
from ..solver.setup import sampled
from ..wrap import landmarks
from .caches import file_name, plain
from .frames import Frames
from .object_bake import ObjectBake


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
