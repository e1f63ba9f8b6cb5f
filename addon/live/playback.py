# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of a live source: solved ahead on a thread, and shown as they are played."""

import threading

from ..blender.host import has_window
from ..core.errors import UserError
from ..core.runtime import native
from ..core.runtime.threads import start_thread
from ..solver.secondary_motion import Simulation

# Cache of a live source's solved frames, and the background thread that fills it.
#
# A frame is solved from rest, so that its shape does not depend on the order of playback. Each shape is
# cached with its request, and is dropped when the handles, the style or the points of its frame have
# changed.

LARGEST = 1 << 30  # bytes of shapes that one source keeps


class SolvedFrames:
    """{frame: shape}, filled by a thread for the frames that are requested, the newest first.

    `clone()` makes the thread's own FrameSolver.
    """

    def __init__(self, clone, low_priority=False):
        self._clone, self._solver = clone, None
        self._changed = threading.Condition()
        self._requests, self._kept = {}, {}  # frame: request; frame: (request, shape or error, edition)
        self._task, self._ended, self._edition, self._bytes = native.library().Task(), False, 0, 0
        self.has_news = False  # whether a frame was solved since Playback.take_news()
        self._thread = start_thread("frames", self._run, low_priority)

    def get(self, frame, request):
        """The shape of that frame for this request; None while it is not solved."""
        with self._changed:
            kept = self._kept.get(frame)
            if kept is None:
                return None
            if not kept[0].is_like(request):
                self._edition += 1  # the animation was edited: count() counts frames seen since then
                self._drop(frame)
                return None
            self._kept[frame] = (*kept[:2], self._edition)
            if isinstance(kept[1], Exception):
                raise UserError("{error}", error=kept[1])
            return kept[1]

    def request(self, frame, request):
        """Has that frame solved next."""
        with self._changed:
            self._requests.pop(frame, None)
            self._requests[frame] = request
            self._changed.notify_all()

    def wait(self, frame, request, timeout):
        """The shape of that frame, requested if necessary; None if it takes longer than `timeout` seconds."""
        shape = self.get(frame, request)
        if shape is None:
            self.request(frame, request)
            with self._changed:
                self._changed.wait_for(lambda: frame in self._kept or self._ended, timeout)
            shape = self.get(frame, request)
        return shape

    def count(self, first, last):
        """How many whole frames of the range are solved for the animation as it was last seen."""
        with self._changed:
            return sum(
                kept[2] == self._edition and first <= frame <= last and frame == int(frame)
                for frame, kept in self._kept.items()
            )

    def stop(self):
        """Ends the thread and waits for it."""
        with self._changed:
            self._ended = True
            self._task.cancel()
            self._changed.notify_all()
        self._thread.join()

    def _next(self):
        return self._requests.popitem()

    def _solve(self, frame, request):
        return self._solver.solve_from_rest(request, self._task)

    def _drop(self, frame):
        self._bytes -= bytes_of(self._kept.pop(frame)[1])

    def _run(self):
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._requests or self._ended)
                if self._ended:
                    return
                frame, request = self._next()
                if frame in self._kept and self._kept[frame][0].is_like(request):
                    continue  # requested again while it was being solved
                edition = self._edition
            try:
                self._solver = self._solver or self._clone()
                shape = self._solve(frame, request)
            except Exception as error:  # raised where the frame is shown
                shape = error
            with self._changed:
                if self._ended:
                    return
                if frame in self._kept:
                    self._bytes -= bytes_of(self._kept.pop(frame)[1])
                while self._kept and self._bytes + bytes_of(shape) > LARGEST:
                    self._drop(next(iter(self._kept)))  # the one that was solved first
                self._kept[frame] = request, shape, edition
                self._bytes += bytes_of(shape)
                self.has_news = True
                self._changed.notify_all()


class SimulatedFrames(SolvedFrames):
    """Frames of a source with secondary motion: each is a time step from the one before.

    A frame that was solved without all earlier ones is solved again once these are known.
    """

    def __init__(self, clone, start, fps, low_priority=False):
        self._simulation = Simulation(start, fps)
        self._rough = set()  # frames that were solved without all earlier ones
        super().__init__(clone, low_priority)

    def get(self, frame, request):
        with self._changed:
            kept = self._kept.get(frame)
            if kept is not None and not kept[0].is_like(request):
                for later in [one for one in self._kept if one > frame]:
                    self._drop(later)
                self._simulation.forget(frame)
            elif frame in self._rough and self._simulation.could_be_exact(frame):
                self._drop(frame)
        return super().get(frame, request)

    def _next(self):
        frame = min(self._requests)
        return frame, self._requests.pop(frame)

    def _solve(self, frame, request):
        simulation = self._simulation
        edition, is_exact = simulation.edition, simulation.could_be_exact(frame)
        try:
            return simulation.shape(self._solver, frame, request, self._task)
        finally:
            with self._changed:
                if not is_exact or edition != simulation.edition:  # or edited meanwhile
                    self._rough.add(frame)

    def _drop(self, frame):
        super()._drop(frame)
        self._rough.discard(frame)


def bytes_of(shape):
    """Bytes of the arrays that a shape does not share with others."""
    parts = getattr(shape, "points", None), getattr(shape, "turns", None)
    carried = sum(part.nbytes for _, part in getattr(shape, "carried", ()))
    return carried + sum(part.nbytes for part in parts if part is not None)


# Tells animation frames from drags in a live session: a frame's shape does not depend on what was shown
# before, a drag's solve starts from the last shape.


class Playback:
    """Animation playback of a session; main thread.

    `frame`: the scene's at the last update; None makes the first request a frame's.
    """

    def __init__(self, solver, frame=None):
        self._solver, self.frame = solver, frame
        self.frames = None  # SolvedFrames, once a frame is requested
        self._shown = None  # the frame's Shape on display
        self._is_requested = False  # whether the current frame is solved or requested

    def steps_motion(self, request, frame):
        """Whether a request steps secondary motion to another frame, also if no handle has moved."""
        return request.motion is not None and frame != self.frame

    def begin(self, request, frame):
        """Starts a new request; True if the session's worker has to solve it."""
        self._solver.is_playing, self._shown = frame != self.frame, None
        kept = None if self.frames is None else self.frames.get(frame, request)
        self._is_requested = kept is not None and self._solver.is_playing
        if self.steps_motion(request, frame):
            self._solver.begin_at_rest()  # for a drag after playback
            return False
        return not self._is_requested

    def advance(self, request, frame):
        """Sets the scene's frame; requests its shape if the request came with a change of frame."""
        self.frame = frame
        if self._solver.is_playing and not self._is_requested and self._solver.frame_solver is not None:
            if self.frames is None:
                self.frames = self._new_frames(request)
            self.frames.request(frame, request)
            self._is_requested = True

    def _new_frames(self, request):
        solver, low_priority = self._solver.frame_solver, has_window()
        if request.motion is None:
            return SolvedFrames(solver.clone, low_priority)
        setup = solver.sampled.setup
        return SimulatedFrames(solver.clone, setup.start, setup.fps, low_priority)

    def wait(self, request, seconds):
        """Waits until the current frame is solved, at most `seconds`; None: without a limit."""
        if self._solver.is_playing:
            self.advance(request, self.frame)
            if self.frames is not None:
                self.frames.wait(self.frame, request, seconds)

    def shape(self, request, otherwise):
        """The current frame's shape if solved (None if shown already); else `otherwise`, the worker's."""
        if not self._solver.is_playing or self.frames is None:
            return otherwise
        shape = self.frames.get(self.frame, request)
        if shape is None:
            return otherwise
        was_shown, self._shown = shape is self._shown, shape
        return None if was_shown else shape

    def take_news(self):
        """Whether frames were solved since the last call."""
        has_news = self.frames is not None and self.frames.has_news
        if has_news:
            self.frames.has_news = False
        return has_news

    def is_shown(self):
        """Whether the current frame's shape is on display, or no frame is requested."""
        return self.frames is None or not self._solver.is_playing or self._shown is not None

    def stop(self):
        if self.frames is not None:
            self.frames.stop()


def scene_frame(scene):
    """The scene's frame with its fraction, rounded so that equal frames compare equal."""
    return round(scene.frame_current + scene.frame_subframe, 4)
