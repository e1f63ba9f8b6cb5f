# SPDX-License-Identifier: GPL-3.0-or-later
"""How a live session tells frames of an animation from drags: a frame's shape is its own, a drag's goes on
from the shape before."""

from ..blender.host import has_window
from .solved_frames import SimulatedFrames, SolvedFrames


class Playback:
    """The scene's frames as a session comes by them; on the main thread.

    `frame` is the scene's when it was last looked at; None where what is there already is a frame's.
    """

    def __init__(self, solver, frame=None):
        self._solver, self.frame = solver, frame
        self.frames = None  # SolvedFrames, once one is asked for
        self._shown = None  # the shape of a frame that is shown
        self._is_requested = False  # whether the frame at hand is solved, or will be

    def steps_motion(self, request, frame):
        """Whether a request is of the next moment of secondary motion, also while its handles hold still."""
        return request.motion is not None and frame != self.frame

    def begin(self, request, frame):
        """Takes a new request; whether the session's own worker has to solve it."""
        self._solver.is_playing, self._shown = frame != self.frame, None
        kept = None if self.frames is None else self.frames.get(frame, request)
        self._is_requested = kept is not None and self._solver.is_playing
        if self.steps_motion(request, frame):
            self._solver.begin_at_rest()  # a drag that follows
            return False
        return not self._is_requested

    def advance(self, request, frame):
        """The scene is at this frame now; requests its shape where the animation has moved the handles."""
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
        """Until the frame at hand is solved, so many seconds at most; None: however long that takes."""
        if self._solver.is_playing:
            self.advance(request, self.frame)
            if self.frames is not None:
                self.frames.wait(self.frame, request, seconds)

    def shape(self, request, otherwise):
        """The frame's own shape, where it is solved and not yet shown, in place of what the worker has."""
        if not self._solver.is_playing or self.frames is None:
            return otherwise
        shape = self.frames.get(self.frame, request)
        if shape is None:
            return otherwise
        was_shown, self._shown = shape is self._shown, shape
        return None if was_shown else shape

    def take_news(self):
        """Whether more frames are solved than when this was asked before."""
        has_news = self.frames is not None and self.frames.has_news
        if has_news:
            self.frames.has_news = False
        return has_news

    def is_shown(self):
        """Whether what is shown is the frame's own shape, or no frame's shape is asked for."""
        return self.frames is None or not self._solver.is_playing or self._shown is not None

    def stop(self):
        if self.frames is not None:
            self.frames.stop()


def scene_frame(scene):
    """The scene's frame with its fraction, rounded so that equal frames compare equal."""
    return round(scene.frame_current + scene.frame_subframe, 4)
