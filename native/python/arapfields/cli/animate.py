# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb animate: a mesh under handles that move from frame to frame, solved frame by frame."""

import errno
import hashlib
import sys
import time
from pathlib import Path

import numpy as np

import arapfields as af

from .._files import whole_file
from .._point_cache_layout import SUFFIXES as CACHES
from .._point_cache_layout import Layout
from ..point_cache import PointCacheWriter
from . import files, usd
from .frames import FrameStore
from .options import given_options
from .running import Outputs, with_progress
from .touching import contact_key, contact_of
from .tracks import read_tracks

STEPS, TOLERANCE = 300, 1e-6  # of a frame's solve, which starts from rest, where nothing else is said
LINES = 15.0  # seconds between lines where there is no terminal


def animate(args):
    with Outputs() as outputs:
        output = outputs.check(args.output, (*CACHES, *usd.SUFFIXES), "--output")
    if output.suffix.lower() in usd.SUFFIXES:
        usd.require_usd()
    options = given_options(af.LiveOptions, args)
    tracks = read_tracks(args.tracks)
    wanted = frames_wanted(args, tracks)
    vertices, triangles = files.read_mesh(args.input)
    secondary = secondary_motion(args)
    contact = contact_of(args), contact_key(args)
    solver = FrameSolver(vertices, triangles, tracks, options, solve_limits(args), secondary, contact)
    solver.check(wanted)
    store = FrameStore(output, len(vertices), solver.description(wanted[0]))
    places = {index: store.place(tracks.start + index, solver.key(index)) for index in wanted}
    number, shards = args.shard or (1, 1)
    with store.only_run(f"{number}-{shards}", places.values()) as first:
        if first:
            text = _run(args, solver, store, tracks, places, triangles)
        else:
            text = f"another animate is at work on the same frames, and makes {output}"
    if not args.quiet:
        print(text)


def _run(args, solver, store, tracks, places, triangles):
    """Solves this run's frames and, where none is missing then, writes the output; says what it did."""
    output, points, wanted = store.output, store.points, list(places)
    number, shards = args.shard or (1, 1)
    mine = [index for index in wanted[number - 1 :: shards] if not store.has(places[index])]
    store.require_room(len(mine), Layout(".pc2", points, len(wanted)).size)
    with_progress("animate", lambda task: _solve(solver, store, places, mine, task, args), args.quiet)
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
    """The options of --secondary; None where frames are to be solved each for itself."""
    options = given_options(af.SecondaryMotionOptions, args)
    given = [name for name in options.fields if getattr(args, f"option_{name}") is not None]
    if given and not args.secondary:
        raise af.InvalidInput(f"--{given[0].replace('_', '-')}: it is for --secondary")
    if args.secondary and args.shard:
        raise af.InvalidInput("--shard: with --secondary each frame follows from the one before")
    return options if args.secondary else None


def solve_limits(args):
    """What a solve from rest may take: more than the options' own, which are for a drag."""
    return {
        "iterations": STEPS if args.option_iterations is None else 0,
        "tolerance": TOLERANCE if args.option_tolerance is None else 0.0,
    }


class FrameSolver:
    """Shapes of a mesh: each from rest, a function of its own frame alone; or with secondary motion, each
    from the one before, the tracks' first at rest."""

    def __init__(self, vertices, triangles, tracks, options, limits, secondary=None, contact=(None, [])):
        self._vertices, self._triangles, self._tracks = vertices, triangles, tracks
        self._options, self._limits, self._secondary = options, limits, secondary
        self._contact, self._contact_key = contact
        self._samples = af.sample_mesh(vertices, triangles, seed=options.seed)
        points = self._samples.points
        self._bounds = np.array([points.min(0), points.max(0)])
        self._live = self._at = None  # the frame that was stepped to
        self._digests = []

    def _handles(self, index):
        return self._tracks.handles(index, self._bounds)

    def check(self, indices):
        """InvalidInput names the first frame whose handles cannot be."""
        for index in indices:
            self._handles(index)

    def description(self, index):
        """Bytes that stand for all that the frames have in common; `index` is any frame's."""
        options = {name: value for name, value in self._options.to_dict().items() if name != "threads"}
        rest = [(type(h).__name__, np.asarray(h.rest).tolist(), h.weight) for h in self._handles(index)]
        further = [] if self._secondary is None else [self._tracks.fps, self._secondary.to_dict()]
        text = repr([af.__version__, options, self._limits, rest, *further, *self._contact_key])
        return text.encode() + self._vertices.tobytes() + self._triangles.tobytes()

    def key(self, index):
        """Arrays that tell the frame's shape from others."""
        if self._secondary is None:
            return self._tracks.targets(index)
        while len(self._digests) <= index:  # of a frame's targets, and of all before
            targets = [
                np.asarray(target, float).tobytes() for target in self._tracks.targets(len(self._digests))
            ]
            self._digests.append(hashlib.blake2b(b"".join([*self._digests[-1:], *targets])).digest())
        return [np.frombuffer(self._digests[index], np.uint8)]

    def positions(self, index, task=None, is_cancelled=bool):
        """(n, 3)"""
        if self._live is None:
            settings = {"contact": self._contact, "task": task}
            self._live = af.LiveDeformer(self._samples, self._handles(index), self._options, **settings)
            self._live.set_secondary_motion(self._secondary)
        if self._secondary is None or self._at is None or index < self._at:
            self._live.reset()
            self._at = index if self._secondary is None else 0
            self._live.solve(self._targets(self._at), **self._limits)
        while self._at < index and not is_cancelled():
            self._at += 1
            self._live.step(self._targets(self._at), 1.0 / self._tracks.fps)
        return self._live.field(self._vertices)

    def _targets(self, index):
        return [handle.target for handle in self._handles(index)]


def _solve(solver, store, places, mine, task, args):
    said = time.monotonic()
    for done, index in enumerate(mine):
        if task.cancelled:
            raise af.Cancelled("cancelled")
        place = places[index]
        name = f"frame {int(place.name[:7])}"
        task.report(done / len(mine), name)
        if not store.has(place):  # another run may have made it meanwhile
            positions = solver.positions(index, task if done == 0 else None, lambda: task.cancelled)
            if task.cancelled:
                raise af.Cancelled("cancelled")
            store.put(place, positions)
        if not args.quiet and not sys.stderr.isatty() and time.monotonic() - said > LINES:
            said = time.monotonic()
            print(f"{name}: {done + 1} of {len(mine)} solved", file=sys.stderr, flush=True)


def _write(output, frames, shape, fps, start, task, args):
    """The output, from `frames` (an iterable of (n, 3)); shape: their number, that of points, triangles."""
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
