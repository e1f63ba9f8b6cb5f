# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb `animate`: meshes or splats under handles that move from frame to frame."""

import errno
import hashlib
import os
import shutil
import sys
import time
from pathlib import Path

import numpy as np

import arapfields as af

from .._files import whole_file
from .._streams import say
from ..point_cache import SUFFIXES as CACHES
from ..point_cache import Layout, PointCacheWriter
from . import files, splat_files, usd
from .command_line import Outputs, with_progress
from .flags import contact_key, contact_of, given_options, result_options
from .frames import FrameStore
from .handles import read_tracks

# Solves the frames of the verb animate.

STEPS, TOLERANCE = 300, 1e-6  # defaults for frames, which are solved from rest


def frames_wanted(args, tracks):
    """Indices of the frames to write."""
    first, last = args.frames or (tracks.start, tracks.start + tracks.count - 1)
    end = tracks.start + tracks.count - 1
    if first > last:
        raise af.InvalidInput(f"--frames: {first} to {last} holds no frame")
    if first < tracks.start or last > end:
        raise af.InvalidInput(f"--frames: {first} to {last}; {tracks.path} has {tracks.start} to {end}")
    return list(range(first - tracks.start, last - tracks.start + 1))


def secondary_motion(args):
    """The options of --secondary; None without it."""
    options = given_options(af.SecondaryMotionOptions, args)
    given = [name for name in options.fields if getattr(args, f"option_{name}") is not None]
    if given and not args.secondary:
        raise af.InvalidInput(f"--{given[0].replace('_', '-')}: it is for --secondary")
    if args.secondary and args.shard:
        raise af.InvalidInput("--shard: with --secondary each frame follows from the one before")
    return options if args.secondary else None


def solve_limits(args):
    """Iterations and tolerance of a solve from rest; the options' defaults are for interactive drags."""
    return {
        "iterations": STEPS if args.option_iterations is None else 0,
        "tolerance": TOLERANCE if args.option_tolerance is None else 0.0,
    }


class FrameSolver:
    """Fields of frames: each solved from rest, or with secondary motion stepped from the frame before,
    beginning with the first frame of the tracks at rest."""

    def __init__(self, samples, tracks, options, args):
        self._samples, self._tracks, self._options = samples, tracks, options
        self._limits, self._secondary = solve_limits(args), secondary_motion(args)
        self._contact, self._contact_key = contact_of(args), contact_key(args)
        points = self._samples.points
        self._bounds = np.array([points.min(0), points.max(0)])
        self._live = self._at = None  # the frame of the last step
        self._digests = []

    def _handles(self, index):
        return self._tracks.handles(index, self._bounds)

    def check(self, indices):
        """InvalidInput names the first frame with invalid handles."""
        for index in indices:
            self._handles(index)

    def description(self, index):
        """Bytes of all inputs that the frames have in common; `index`: any frame."""
        rest = [(type(h).__name__, np.asarray(h.rest).tolist(), h.weight) for h in self._handles(index)]
        further = [] if self._secondary is None else [self._tracks.fps, self._secondary.to_dict()]
        text = repr(
            [af.__version__, result_options(self._options), self._limits, rest, *further, *self._contact_key]
        )
        return text.encode()

    def key(self, index):
        """Arrays that determine the frame's shape."""
        if self._secondary is None:
            return self._tracks.targets(index)
        while len(self._digests) <= index:  # each of a frame's targets and the digest before
            targets = [
                np.asarray(target, float).tobytes() for target in self._tracks.targets(len(self._digests))
            ]
            self._digests.append(hashlib.blake2b(b"".join([*self._digests[-1:], *targets])).digest())
        return [np.frombuffer(self._digests[index], np.uint8)]

    def field(self, index, task):
        """The field of a frame; raises Cancelled if the task is cancelled."""
        if self._live is None:
            settings = {"contact": self._contact, "task": task}
            self._live = af.LiveDeformer(self._samples, self._handles(index), self._options, **settings)
            self._live.set_secondary_motion(self._secondary)
        if self._secondary is None or self._at is None or index < self._at:
            self._live.reset()
            self._at = index if self._secondary is None else 0
            self._live.solve(self._targets(self._at), **self._limits)
        while self._at < index and not task.cancelled:
            self._at += 1
            self._live.step(self._targets(self._at), 1.0 / self._tracks.fps)
        if task.cancelled:
            raise af.Cancelled("cancelled")
        return self._live.field

    def _targets(self, index):
        return [handle.target for handle in self._handles(index)]


# The verb animate for Gaussian splats: a file per frame, or one of USD.

SAMPLES = 6000


def animate_splats(args):
    options, tracks = given_options(af.LiveOptions, args), read_tracks(args.tracks)
    number, shards = args.shard or (1, 1)
    mine = frames_wanted(args, tracks)[number - 1 :: shards]
    with Outputs() as outputs:
        output = outputs.check(args.output, splat_files.SUFFIXES, "--output")
        splat_files.require_writable(output)
        in_one = output.suffix.lower() not in splat_files.FRAMED
        if in_one and args.shard:
            raise af.InvalidInput("--shard: USD has all frames in one file; write .ply or .glb")
        places = [] if in_one else [frame_place(output, tracks.start + index) for index in mine]
        for place in places:
            outputs.check(place, splat_files.FRAMED, "--output")
    needed, free = len(mine) * Path(args.input).stat().st_size, shutil.disk_usage(output.parent).free
    if free < needed:
        text = f"{os.strerror(errno.ENOSPC)}: {needed:,} bytes are needed, {free:,} are free"
        raise OSError(errno.ENOSPC, text, str(output.parent))
    written = {"up": args.up_axis, "name": Path(args.input).stem}

    def solve(task):
        splats = af.GaussianSplats.load(args.input)
        solver = FrameSolver(af.sample_splats(splats, SAMPLES, task=task), tracks, options, args)
        solver.check(mine)
        prepared = af.PreparedSplats(splats)

        def frames():
            moved = None
            for done, index in enumerate(mine):
                task.report(done / len(mine), f"frame {tracks.start + index}")
                moved = prepared.moved(solver.field(index, task), moved)
                yield moved

        if in_one:
            start = tracks.start + mine[0]
            with whole_file(output) as partial:
                file = usd.SplatFile(partial, fps=tracks.fps, start=start, **written)
                for moved in frames():
                    file.add(moved)
                file.finish()
            return
        for place, moved in zip(places, frames(), strict=True):
            splat_files.write(place, moved, **written)

    with_progress("animate", solve, args.quiet)
    if not args.quiet:
        wrote = output if in_one else f"{places[0]} to {places[-1].name}" if places else ""
        say(f"{len(mine)} frames solved; wrote {wrote}" if wrote else "no frames", "stdout")


def frame_place(output, frame):
    """The path of a frame's file."""
    return output.with_name(f"{output.stem}.{frame:04d}{output.suffix}")


# The verb animate: deforms a mesh by handles that move from frame to frame.

LINES = 15.0  # seconds between lines of progress without a terminal


def animate(args):
    if af.GaussianSplats.is_file(args.input):
        animate_splats(args)
        return
    with Outputs() as outputs:
        output = outputs.check(args.output, (*CACHES, *usd.SUFFIXES), "--output")
    if output.suffix.lower() in usd.SUFFIXES:
        usd.require_usd()
    options = given_options(af.LiveOptions, args)
    tracks = read_tracks(args.tracks)
    wanted = frames_wanted(args, tracks)
    vertices, triangles = files.read_mesh(args.input)
    files.tell_loss(output, vertices)
    solver = FrameSolver(af.sample_mesh(vertices, triangles, seed=options.seed), tracks, options, args)
    solver.check(wanted)
    whole = solver.description(wanted[0]) + vertices.tobytes() + triangles.tobytes()
    store = FrameStore(output, len(vertices), whole)
    places = {index: store.place(tracks.start + index, solver.key(index)) for index in wanted}
    number, shards = args.shard or (1, 1)
    with store.only_run(f"{number}-{shards}", places.values()) as first:
        if first:
            text = _run(args, solver, store, tracks, places, (vertices, triangles))
        else:
            text = f"another animate is at work on the same frames, and makes {output}"
    if not args.quiet:
        say(text, "stdout")


def _run(args, solver, store, tracks, places, mesh):
    """Solves the frames of this run, and writes the output if all frames are solved; returns a message."""
    output, points, wanted = store.output, store.points, list(places)
    (vertices, triangles), (number, shards) = mesh, args.shard or (1, 1)
    mine = [index for index in wanted[number - 1 :: shards] if not store.has(places[index])]
    store.require_room(len(mine), Layout(".pc2", points, len(wanted)).size)
    with_progress(
        "animate", lambda task: _solve(solver, vertices, store, places, mine, task, args), args.quiet
    )
    text = f"{len(mine)} frames solved, {len(wanted) - len(mine)} there already or another's"
    with store.alone():
        missing = sum(not store.has(place) for place in places.values())
        if missing and shards == 1:
            raise OSError(errno.EIO, f"{missing} solved frames have gone; run it again", str(store.folder))
        if missing:
            text += f"; {missing} of {len(wanted)} to come: who solves the last one makes {output}"
        else:
            frames = (store.get(place) for place in places.values())
            start = tracks.start + wanted[0]
            shape = len(wanted), points, triangles
            with_progress("write", lambda task: _write(output, frames, shape, tracks.fps, start, task, args))
            store.remove(places.values() if args.frames else None)
            end = start + len(wanted) - 1
            text += f"; wrote {output}: frames {start} to {end}, {tracks.fps:g} a second"
    return text


def _solve(solver, vertices, store, places, mine, task, args):
    said = time.monotonic()
    for done, index in enumerate(mine):
        if task.cancelled:
            raise af.Cancelled("cancelled")
        place = places[index]
        name = f"frame {int(place.name[:7])}"
        task.report(done / len(mine), name)
        if not store.has(place):  # another run may have solved it meanwhile
            store.put(place, solver.field(index, task)(vertices))
        if not args.quiet and not sys.stderr.isatty() and time.monotonic() - said > LINES:
            said = time.monotonic()
            say(f"{name}: {done + 1} of {len(mine)} solved")


def _write(output, frames, shape, fps, start, task, args):
    """Writes the output; `frames`: iterable of (n, 3); shape: numbers of frames and points, the triangles."""
    count, points, triangles = shape

    def told():
        for number, frame in enumerate(frames):
            if task.cancelled:
                raise af.Cancelled("cancelled")
            task.report(number / count, "writing")
            yield frame

    if output.suffix.lower() in usd.SUFFIXES:
        settings = {"fps": fps, "start": start, "up": args.up_axis, "name": Path(args.input).stem}
        with whole_file(output) as partial:
            usd.write_usd(partial, triangles, told(), **settings)
        return
    with PointCacheWriter(output, points, count, start=start, fps=fps) as cache:
        for frame in told():
            cache.write(frame)
