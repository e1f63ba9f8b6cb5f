# SPDX-License-Identifier: GPL-3.0-or-later
"""What a live session's worker does: a drag's shapes go on from those before, and end in one from rest."""

import time

import numpy as np

from ..core.runtime import native
from ..solver.frame_solver import FrameSolver
from ..solver.setup import sampled
from .prefetch import prefetch

STEPS, MOST_SHAPES = 3, 60  # quasi-Newton steps to each shape of a request, and how many of these there are
# A shape is shown once it is that near the one before, as a share of the size: its own last is then at most
# four times as far. After so many seconds any is shown. A newer request waits for one that is shown.
NEAR, LATEST = 7e-4, 0.2
TOLERANCE = 3e-5  # what single precision sees; a shape then is within about 0.3 % of the size
PACE = 1 / 60  # seconds from one shape to the next in secondary motion
MOST_PACES = 3  # that a step in real time stands for; fewer lengths of steps, fewer preconditioners
STILL, STILL_STEPS = 1e-3, 20  # of the size a second, so many steps in turn: it has come to rest


class LiveSolver:
    """Made on the main thread; `prepare`, `solve` and `refine` run on the worker."""

    def __init__(self, reader):
        self._reader, self.frame_solver = reader, None
        self.solved_request = None  # the request of the last shape
        self.is_playing = False  # whether the newest request is a frame's, which another thread solves
        self._stepped_at = None  # when the last step in real time ended; None: the next begins at rest
        self._stepped_motion = None
        self._tracked = None  # (n, 3) the points of the last shape, in solve space

    @property
    def samples(self):
        return self.frame_solver.sampled.samples

    @property
    def field(self):
        return self.frame_solver.solver.field

    @property
    def report(self):
        return self.frame_solver.solver.report

    def prepare(self):
        """Sets the solver up, or takes the one that was prefetched."""
        setup, carrying = self._reader.setup, self._reader.carrying
        ready = prefetch.take(setup)
        self.frame_solver = ready.reuse(setup, carrying) if ready else FrameSolver(sampled(setup), carrying)
        self.frame_solver.shows_touch = True

    def begin_at_rest(self):
        """Has the next step of secondary motion begin at rest."""
        self._stepped_at = None

    def solve(self, request):
        """Yields a shape for this request, quickly, and then better ones."""
        if request.motion is not None:
            self._step(request)
            self.solved_request = request
            yield self.frame_solver.tracked_shape(request)
            return
        earlier, self.solved_request = self.solved_request, request
        if earlier is not None and not request.goes_on_from(earlier):
            self.frame_solver.solver.reset()
        latest = time.monotonic() + LATEST
        for _ in range(MOST_SHAPES):
            taken = self.frame_solver.follow(request, iterations=STEPS, tolerance=TOLERANCE)
            if self._is_near() or taken < STEPS or time.monotonic() > latest:
                yield self.frame_solver.tracked_shape(request)
            if taken < STEPS:
                break

    def _is_near(self):
        """Whether the points are near where they were when this was asked before."""
        before, self._tracked = self._tracked, self.frame_solver.solver.tracked()
        size = np.ptp(self.samples.points, axis=0).max()
        return before is not None and np.abs(self._tracked - before).max() < NEAR * size

    def refine(self, request, token):
        """Yields the request's own shape, from rest; where there is motion, once that has ended."""
        if self.is_playing:
            return
        if request.motion is not None:
            yield from self._settle(request, token)
        solver = self.frame_solver.solver
        before = solver.motion_state
        try:
            yield self.frame_solver.solve_from_rest(request, token.watch(native.library().Task()))
        except native.library().Cancelled:
            solver.motion_state = before  # a drag goes on

    def _step(self, request):
        """Steps to the request in as many seconds as have passed since the last step."""
        now, before = time.monotonic(), self._stepped_at
        if before is None:
            self.frame_solver.solver.solve(self.frame_solver.apply_request(request))
        else:
            paces = int(np.clip(round((now - before) / PACE), 1, MOST_PACES))
            self.frame_solver.step(request, PACE * paces, self._stepped_motion)
        self._stepped_at, self._stepped_motion = now, request.motion

    def _settle(self, request, token):
        """Yields shapes in real time until it has come to rest."""
        still, size = 0, np.ptp(self.samples.points, axis=0).max()
        while still < STILL_STEPS and not token.cancelled:
            began = time.monotonic()
            self._step(request)
            still = still + 1 if self.report.speed < STILL * size else 0
            yield self.frame_solver.tracked_shape(request)
            time.sleep(max(0.0, began + PACE - time.monotonic()))
