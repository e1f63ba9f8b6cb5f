# SPDX-License-Identifier: GPL-3.0-or-later
"""wrap with --sequence: a template onto each frame of a scanned motion, as a point cache."""

import re
from pathlib import Path

import arapfields as af

from .._point_cache_layout import SUFFIXES as CACHES
from .._streams import say
from ..point_cache import PointCacheWriter
from . import files, sources, wrap_folder
from .frames import FrameStore
from .options import given
from .running import Outputs, with_progress
from .wrap_frames import HeldFrames, WrappedFrames, made_of

NOT_OF_FRAMES = ("shard", "save_field", "suggest", "report")


def frames_of(folder):
    """The meshes of a folder, sorted by the numbers in their names."""
    paths = [path for path in Path(folder).iterdir() if path.suffix.lower() in sources.SOURCES]
    if not paths:
        raise af.InvalidInput(f"{folder}: holds no mesh")
    return sorted(paths, key=lambda path: by_numbers(path.stem))


def by_numbers(name):
    """Sort key of names by their numbers: scan 2 before scan 10."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def run(args, options, pairs):
    """Wraps onto each frame from the last good one; `pairs`: landmarks of the first.

    InvalidInput at the end names all bad frames.
    """
    for name in NOT_OF_FRAMES:
        if getattr(args, name):
            raise af.InvalidInput(f"--{name.replace('_', '-')}: has no meaning with --sequence")
    if not Path(args.target).is_dir():
        raise af.InvalidInput(f"--sequence: {args.target} is no folder of frames")
    if not args.output:
        raise af.InvalidInput("no output: give --output")
    with Outputs() as outputs:
        output = outputs.check(args.output, CACHES, "--output")
    paths, source = frames_of(args.target), sources.Source(args)
    if source.mesh is None:
        raise af.InvalidInput(f"{source.path}: holds no mesh to move")
    vertices = source.mesh.vertices
    files.tell_loss(output, vertices)
    samples = sources.samples(source, given(args, "wrap", "samples"), options.seed, args)
    store = FrameStore(output, len(vertices), made_of(samples, options).digest())
    with store.only_run("sequence", [store.place(0, [])]) as first:
        if not first:
            raise af.InvalidInput(f"{output}: another wrap is at work on the same frames")
        frames = WrappedFrames(store.folder, samples, options)
        failed = write(output, frames, paths, pairs, vertices, args.quiet)
    wrap_folder.refuse(failed, len(paths))


def write(output, frames, paths, pairs, vertices, quiet):
    """Writes the cache if any frame is good; returns the errors of bad frames."""
    worst, failed = (-1.0, ""), []
    with PointCacheWriter(output, points=len(vertices), frames=len(paths), start=1) as cache:
        held = HeldFrames(cache.write)
        for path in paths:
            shape = None
            try:
                field, report = frames.follow(
                    sources.content(path),
                    lambda path=path: sources.read_distance(path),
                    pairs,
                    lambda call, path=path: with_progress(path.stem, call, quiet),
                )
                shape, worst = field(vertices), max(worst, (wrap_folder.off(report.to_dict()), path.name))
            except (af.InvalidInput, af.Diverged) as error:
                failed.append(f"{path.name}: {error}")
            held.add(shape)
        if not frames.good:
            wrap_folder.refuse(failed, len(paths))
    frames.forget_others()
    if not quiet:
        there = f", {frames.found} there already" if frames.found else ""
        off, name = worst
        text = (
            f"wrote {output}: {len(paths)} frames{there}, {off:.2%} of the target's size off at most ({name})"
        )
        say(text, "stdout")
    return failed
