# SPDX-License-Identifier: GPL-3.0-or-later
"""wrap with --sequence: one template onto each frame of a scanned motion, into a point cache."""

import re
from pathlib import Path

import arapfields as af

from .._point_cache_layout import SUFFIXES as CACHES
from ..point_cache import PointCacheWriter
from . import sources
from .options import given
from .running import Outputs, with_progress

NOT_OF_FRAMES = ("shard", "save_field", "suggest", "report")


def frames_of(folder):
    """The meshes of a folder, by the numbers in their names: 2 before 10."""
    paths = [path for path in Path(folder).iterdir() if path.suffix.lower() in sources.SOURCES]
    if not paths:
        raise af.InvalidInput(f"{folder}: holds no mesh")
    return sorted(paths, key=lambda path: by_numbers(path.stem))


def by_numbers(name):
    """What names are ordered by: scan 2 comes before scan 10."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def run(args, options, pairs):
    """Wraps each frame from the last one; `pairs` of landmarks are those of the first."""
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
    vertices = source.mesh[0]
    samples = sources.samples(source, given(args, "wrap", "samples"), options.seed, args)
    worst = (0.0, "")
    with PointCacheWriter(output, points=len(vertices), frames=len(paths), start=1) as cache:
        sequence = None
        for path in paths:
            frame = sources.read_distance(path)

            def wrapped(task, frame=frame, sequence=sequence):
                if sequence is None:
                    return af.wrap(samples, frame, pairs, options, task=task)
                return sequence.next(frame, task=task)

            try:
                field = with_progress(path.stem, wrapped, args.quiet)
            except (af.InvalidInput, af.Diverged) as error:
                raise type(error)(f"{path.name}: {error}") from error
            sequence = sequence or af.WrapSequence(samples, field, options)
            off = max(field.report.to_target_mean, field.report.from_target_mean)
            worst = max(worst, (off, path.name))
            cache.write(field(vertices))
    if not args.quiet:
        text = f"{worst[0]:.2%} of the target's size off at most ({worst[1]})"
        print(f"wrote {output}: {len(paths)} frames, {text}")
