# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb animate for Gaussian splats: a PLY file per frame."""

import errno
import os
import shutil
from pathlib import Path

import arapfields as af

from .._streams import say
from .frame_solver import FrameSolver, frames_wanted
from .options import given_options
from .running import Outputs, with_progress
from .tracks import read_tracks

SAMPLES = 6000


def animate_splats(args):
    options, tracks = given_options(af.LiveOptions, args), read_tracks(args.tracks)
    number, shards = args.shard or (1, 1)
    mine = frames_wanted(args, tracks)[number - 1 :: shards]
    with Outputs() as outputs:
        output = outputs.check(args.output, (".ply",), "--output")
        places = [output.with_name(f"{output.stem}.{tracks.start + index:04d}.ply") for index in mine]
        for place in places:
            outputs.check(place, (".ply",), "--output")
    needed, free = len(mine) * Path(args.input).stat().st_size, shutil.disk_usage(output.parent).free
    if free < needed:
        text = f"{os.strerror(errno.ENOSPC)}: {needed:,} bytes are needed, {free:,} are free"
        raise OSError(errno.ENOSPC, text, str(output.parent))

    def solve(task):
        splats = af.GaussianSplats.load(args.input)
        solver = FrameSolver(af.sample_splats(splats, SAMPLES, task=task), tracks, options, args)
        solver.check(mine)
        prepared, moved = af.PreparedSplats(splats), None
        for done, (index, place) in enumerate(zip(mine, places, strict=True)):
            task.report(done / len(mine), place.name)
            moved = prepared.moved(solver.field(index, task), moved)
            moved.save(place)

    with_progress("animate", solve, args.quiet)
    if not args.quiet:
        text = f"{len(mine)} frames solved; wrote {places[0]} to {places[-1].name}" if mine else "no frames"
        say(text, "stdout")
