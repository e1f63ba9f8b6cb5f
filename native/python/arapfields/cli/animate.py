# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb animate: deforms a mesh by handles that move from frame to frame."""

import errno
import sys
import time
from pathlib import Path

import arapfields as af

from .._files import whole_file
from .._point_cache_layout import SUFFIXES as CACHES
from .._point_cache_layout import Layout
from .._streams import say
from ..point_cache import PointCacheWriter
from . import files, usd
from .frame_solver import FrameSolver, frames_wanted
from .frames import FrameStore
from .handles import read_tracks
from .options import given_options
from .running import Outputs, with_progress
from .splat_frames import animate_splats

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
