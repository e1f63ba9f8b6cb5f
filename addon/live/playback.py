# SPDX-License-Identifier: GPL-3.0-or-later
"""Tells animation frames from drags in a live session: a frame's shape does not depend on what was shown
before, a drag's solve starts from the last shape."""

from ..blender.host import has_window
from .solved_frames import SimulatedFrames, SolvedFrames


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
