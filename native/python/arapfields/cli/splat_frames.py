# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb animate for Gaussian splats: a file per frame, or one of USD."""

import errno
import os
import shutil
from pathlib import Path

import arapfields as af

from .._files import whole_file
from .._streams import say
from . import splat_files, usd
from .frame_solver import FrameSolver, frames_wanted
from .handles import read_tracks
from .options import given_options
from .running import Outputs, with_progress

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
