# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver of a live session on its worker, and one that is set up before a session starts."""

import collections
import time

import numpy as np

from ..blender.evaluation import world_matrix
from ..blender.host import has_window
from ..blender.object_references import settings_of
from ..blender.point_data import points_of
from ..blender.user_preferences import machine_options
from ..core.errors import UserError
from ..core.runtime import native
from ..core.runtime.threads import start_thread
from ..handles import symmetry
from ..results import placement
from ..solver.frame_solver import FrameSolver, SolverSetup, energy_weights, sampled
from ..surface.source_surface import read_surface

# Sets a solver up before live mode starts, for the object that a tool names as the next one.

LARGEST = 200_000  # most vertices of a source that is prefetched


class SolverPrefetch:
    """At most one solver, without handles, of the source that was prepared last."""

    def __init__(self):
        self._uid = self._thread = self._solver = None

    def prepare(self, context, source):
        """Sets a solver up for deforming the source in place, on a thread; main thread."""
        settings = settings_of(source)
        if self._uid == source.session_uid or len(points_of(source.data)) > LARGEST:
            return
        if not placement.in_place(settings.output, settings.result):
            return
        self.clear()
        self._uid = source.session_uid
        try:
            space = symmetry.space_for(source, world_matrix(source))
            surface = read_surface(context, source, in_place=True, space=space)
        except UserError:
            return
        setup = SolverSetup("DEFORM", surface, None, energy_weights(settings, "DEFORM"), machine_options())
        if surface.exact:  # otherwise a fit is needed, which may take minutes
            self._thread = start_thread("prefetch", lambda: self._make(setup), has_window())

    def _make(self, setup):
        try:
            self._solver = FrameSolver(sampled(setup), None)
        except (ValueError, UserError):  # the session's own setup reports it
            self._solver = None

    def take(self, setup):
        """Hands over the FrameSolver if its surface and energy fit the setup, whatever its handles and
        masses; else None. On a worker."""
        surface = setup.surface
        needs_own = setup.kind != "DEFORM" or not surface.in_place or surface.solids
        if needs_own or self._uid != surface.reference.uid or self._thread is None:
            return None
        solver = self.clear()
        return solver if solver is not None and is_same(solver.sampled.setup, setup) else None

    def clear(self):
        """Waits for the thread; returns its solver, or None."""
        if self._thread is not None:
            self._thread.join()
        solver = self._solver
        self._uid = self._thread = self._solver = None
        return solver


def is_same(a, b):
    """Whether two setups have the same energy, and surfaces that are the same bit for bit."""
    one, other = a.surface, b.surface
    return (
        a.energy == b.energy
        and one.exact == other.exact
        and all(factors is None for factors in other.stiffness)
        and np.array_equal(one.vertices, other.vertices)
        and np.array_equal(one.triangles, other.triangles)
    )


prefetch = SolverPrefetch()


# Solver of a live session's worker: during a drag each solve starts from the last one, then from rest.

STEPS, MOST_SHAPES = 3, 60  # quasi-Newton iterations per shape, and most shapes per request
# A shape is shown once no point has moved by more than NEAR times the size since the last one: the converged
# shape is then at most four times as far. After LATEST seconds every shape is shown. A newer request waits
# until one is shown. A style's solve from rest, which is finished on the mesh, comes soon after that.
NEAR, LATEST = 7e-4, 0.2
TOLERANCE = 3e-5  # limit of single precision; the last shape is within about 0.3 % of the size
# A time step of secondary motion is one to MOST_PACES times PACE seconds: each length has its preconditioner.
PACE, MOST_PACES = 1 / 60, 3
# Secondary motion is at rest once all shapes of so many steps are within this share of the size, by so many
# of their points. Its speed would not tell: of a shape that is stretched, steps tremble by rounding for ever.
STILL, STILL_STEPS, STILL_POINTS = 2e-3, 60, 1000


class LiveSolver:
    """Made on the main thread; `prepare`, `solve` and `refine` run on the worker."""

    def __init__(self, reader):
        self._reader, self.frame_solver = reader, None
        self.solved_request = None  # the request of the last shape
        # Whether the newest request's shape at rest is on display, as after a cancelled move. It is solved
        # from rest: the way back from the drag may be long, and end in another shape beside obstacles.
        self.returns = False
        self.is_playing = False  # whether the newest request is an animation frame, solved by SolvedFrames
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
        if self.returns:
            self.frame_solver.apply_request(request)  # before reset(): obstacles then start in place
        if self.returns or (earlier is not None and not request.goes_on_from(earlier)):
            self.frame_solver.solver.reset()
        latest = time.monotonic() + LATEST
        for _ in range(MOST_SHAPES):
            taken = self.frame_solver.follow(request, iterations=STEPS, tolerance=TOLERANCE)
            if self._is_near() or taken < STEPS or time.monotonic() > latest:
                yield self.frame_solver.tracked_shape(request)
            if taken < STEPS or (request.style is not None and time.monotonic() > latest):
                break

    def _is_near(self):
        """Whether the tracked points have moved by less than NEAR since the last call."""
        before, self._tracked = self._tracked, self.frame_solver.solver.tracked()
        size = np.ptp(self.samples.points, axis=0).max()
        return before is not None and np.abs(self._tracked - before).max() < NEAR * size

    def refine(self, request, token):
        """Yields the request's shape solved from rest; before it, secondary motion until this has settled."""
        if self.is_playing:
            return
        if request.motion is not None:
            yield from self._settle(request, token)
        solver = self.frame_solver.solver
        before = solver.motion_state
        try:
            yield self.frame_solver.solve_from_rest(request, token.watch(native.library().Task()))
        except native.library().Cancelled:
            solver.motion_state = before  # the next solve of the drag starts there

    def _step(self, request):
        """Integrates secondary motion over the time since the last step."""
        now, before = time.monotonic(), self._stepped_at
        if before is None:
            self.frame_solver.solver.solve(self.frame_solver.apply_request(request))
        else:
            paces = int(np.clip(round((now - before) / PACE), 1, MOST_PACES))
            self.frame_solver.step(request, PACE * paces, self._stepped_motion)
        self._stepped_at, self._stepped_motion = now, request.motion

    def _settle(self, request, token):
        """Yields shapes in real time until the motion has come to rest."""
        size, last = np.ptp(self.samples.points, axis=0).max(), collections.deque(maxlen=STILL_STEPS)
        while not token.cancelled:
            began = time.monotonic()
            self._step(request)
            yield self.frame_solver.tracked_shape(request)
            points = self.frame_solver.solver.tracked()
            last.append(points[:: max(1, len(points) // STILL_POINTS)].copy())
            if len(last) == STILL_STEPS and np.abs(np.array(last) - last[-1]).max() < STILL * size:
                break
            time.sleep(max(0.0, began + PACE - time.monotonic()))
