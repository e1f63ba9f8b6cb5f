# SPDX-License-Identifier: GPL-3.0-or-later
"""Solves the frames of the verb animate."""

import hashlib

import numpy as np

import arapfields as af

from .flags import contact_key, contact_of
from .options import given_options, result_options

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
