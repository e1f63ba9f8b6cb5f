# SPDX-License-Identifier: GPL-3.0-or-later
"""A source frame by frame; with secondary motion each goes on from the whole frame before it.

At the start frame, and before it, the source is at rest where its handles are. Every frame after is one step
from the last whole one, so that frames in between change nothing, and live mode and bakes make the same bits.
"""

from math import ceil
from typing import Any, NamedTuple

GAP = 12  # frames that playback may drop and still go on from the last one that was seen


class Moment(NamedTuple):
    """What the next frame goes on from."""

    state: Any  # native MotionState
    motion: Any  # SecondaryMotion, with where the source was in the world
    is_exact: bool  # whether every frame from the start frame on led here


class Simulation:
    """The moments of an animation that begins at a frame; not for several threads at once."""

    def __init__(self, start, fps):
        self.start, self.fps = start, fps
        self.moments = {}  # whole frame: Moment
        self.edition = 0  # how often moments were forgotten

    def shape(self, solver, frame, request, task=None):
        """The shape of a frame, by a FrameSolver; kept as what later ones go on from where it is whole."""
        before, edition = self.before(frame), self.edition
        if before is None:
            shape, is_exact = solver.solve_from_rest(request, task), frame <= self.start
        else:
            moment = self.moments[before]
            solver.step(request, (frame - before) / self.fps, moment.motion, moment.state, task)
            shape = solver.exact_shape(request)
            is_exact = moment.is_exact and frame - before <= 1
        if frame == int(frame) and edition == self.edition:
            self.moments[int(frame)] = Moment(solver.solver.motion_state, request.motion, is_exact)
        return shape

    def before(self, frame):
        """The frame that this one goes on from; None where it begins at rest."""
        if frame <= self.start:
            return None
        last = ceil(frame) - 1
        first = max(self.start, last - GAP + 1)
        return next((one for one in range(last, first - 1, -1) if one in self.moments), None)

    def could_be_exact(self, frame):
        """Whether every frame that leads to this one is there, or it is one at rest."""
        before = self.before(frame)
        return frame <= self.start or (
            before is not None and frame - before <= 1 and self.moments[before].is_exact
        )

    def forget(self, frame):
        """That frame and all after it: the animation was edited there."""
        self.edition += 1
        for one in [one for one in list(self.moments) if one >= frame]:
            del self.moments[one]


class Poses:
    """Frames without secondary motion, each from rest: one in which nothing moves is that before it."""

    last = None  # Shape

    def shape(self, solver, request, task=None):
        if self.last is None or not request.is_like(self.last.of):
            self.last = solver.solve_from_rest(request, task)
        return self.last
