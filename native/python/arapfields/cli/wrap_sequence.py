# SPDX-License-Identifier: GPL-3.0-or-later
"""wrap with --sequence: one template onto each frame of a scanned motion, into a point cache."""

import hashlib
import re
from pathlib import Path

import numpy as np

import arapfields as af

from .._point_cache_layout import SUFFIXES as CACHES
from .._point_cache_layout import Layout
from ..point_cache import PointCacheWriter
from . import sources, wrap_folder
from .frames import FrameStore
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
    """Wraps each frame from the last good one; `pairs` of landmarks are those of the first.

    A bad frame has the shape before it, or the first one; InvalidInput at the end names all of these.
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
    vertices = source.mesh[0]
    samples = sources.samples(source, given(args, "wrap", "samples"), options.seed, args)
    made = wrap_folder.made_of(source.path, options, samples)
    made.update(repr(np.array(pairs).tolist()).encode())
    store = FrameStore(output, len(vertices), made.digest())
    with store.only_run("sequence", [store.place(0, [])]) as first:
        if not first:
            raise af.InvalidInput(f"{output}: another wrap is at work on the same frames")
        store.require_room(len(paths), Layout(output.suffix.lower(), len(vertices), len(paths)).size)
        try:
            follower = Follower(store, samples, pairs, options, vertices)
            places, failed = follower.follow_all(paths, args.quiet)
        except NoField:  # one of the frames before the last one that was wrapped has changed
            for path in store.folder.glob("[0-9]*"):
                path.unlink()
            follower = Follower(store, samples, pairs, options, vertices)
            places, failed = follower.follow_all(paths, args.quiet)
        if follower.last is not None:
            write(output, store, places)
            if not args.quiet:
                print(f"wrote {output}: {len(paths)} frames{follower.figures()}")
        if not failed:
            store.remove()
    wrap_folder.refuse(failed, len(paths))


def write(output, store, places):
    """The cache; where there is no place, the frame has the shape before it, or the first one."""
    shape = store.get(next(place for place in places if place is not None))
    with PointCacheWriter(output, points=store.points, frames=len(places), start=1) as cache:
        for place in places:
            shape = shape if place is None else store.get(place)
            cache.write(shape)


class NoField(Exception):
    """There is none from which to go on."""


class Follower:
    """Wraps frame after frame into a FrameStore, those that are not there already.

    A frame's place tells its file and all good frames before it. Beside a frame from which others may have to
    go on lies its field.
    """

    def __init__(self, store, samples, pairs, options, vertices):
        self.store, self.samples, self.pairs, self.options = store, samples, pairs, options
        self.vertices, self.last, self.good = vertices, None, 0  # the place of the last good frame
        self.sequence, self.behind = None, None  # and that of the frame after which it goes on
        self.is_next, self.worst, self.wrapped = True, (0.0, ""), 0

    def follow_all(self, paths, quiet):
        """Each frame's place, None for a bad one, and what is wrong with these."""
        places, failed = [], []
        for path in paths:
            try:
                places.append(self._follow(path, quiet))
            except (af.InvalidInput, af.Diverged) as error:
                failed.append(f"{path.name}: {error}")
                places.append(None)
        return places, failed

    def _follow(self, path, quiet):
        was_next, self.is_next = self.is_next, False
        made = hashlib.blake2b(sources.content(path))
        made.update(self.last.name.encode() if self.last else b"")
        place = self.store.place(self.good, [np.frombuffer(made.digest(), np.uint8)])
        if not self.store.has(place):
            frame = sources.read_distance(path)
            self._resume_after_last()
            field = with_progress(path.stem, lambda task: self._wrap(frame, task), quiet)
            self.behind = None
            field.save(field_of(place))
            self.store.put(place, field(self.vertices))
            self.behind = place if self.sequence else None
            if self.last and was_next:
                field_of(self.last).unlink(missing_ok=True)
            off = wrap_folder.off(field.report.to_dict())
            self.worst, self.wrapped = max(self.worst, (off, path.name)), self.wrapped + 1
        self.last, self.good, self.is_next = place, self.good + 1, True
        return place

    def _resume_after_last(self):
        if self.last == self.behind:
            return
        try:
            field = af.DeformationField.load(field_of(self.last))
        except (af.InvalidInput, OSError) as error:
            raise NoField from error
        self.sequence, self.behind = af.WrapSequence(self.samples, field, self.options), self.last

    def _wrap(self, frame, task):
        if self.sequence is None:
            return af.wrap(self.samples, frame, self.pairs, self.options, task=task)
        return self.sequence.next(frame, task=task)

    def figures(self):
        there = f", {self.good - self.wrapped} there already" if self.good > self.wrapped else ""
        off, name = self.worst
        return there + (f", {off:.2%} of the target's size off at most ({name})" if name else "")


def field_of(place):
    return place.with_name(f"{place.name}.safetensors")
