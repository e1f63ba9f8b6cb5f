# SPDX-License-Identifier: GPL-3.0-or-later
"""How a live session tells frames of an animation from drags: a frame's shape is its own, a drag's goes on
from the shape before."""

from ..blender.host import has_window
from .frames import SimulatedFrames, SolvedFrames
from .request import alike
from .solving import Solving

PATIENCE = 1.0  # seconds at most that playback waits for a frame of secondary motion


class Following(Solving):
    """Mixin of a session; on the main thread."""

    frame = None  # of the scene when it was last looked at; None: what is there already is a frame's
    frames = exact = None  # frames that were solved, and the shape of one of them that is shown
    is_asked = False  # whether the frame at hand is solved, or will be

    def take(self, request, frame):
        """Goes for this request, which was read at that frame of the scene."""
        swings = request.body is not None and frame != self.frame  # also while its handles hold still
        if self.requested is None or swings or not alike(request, self.requested):
            self.requested, self.quiet = request, self.is_restored
            self.follows_animation, self.exact = frame != self.frame, None
            kept = None if self.frames is None else self.frames.get(frame, request)
            self.is_asked = kept is not None and self.follows_animation
            if swings:
                self.clock = None  # a drag that follows begins at rest
            elif not self.is_asked:
                self.worker.request(request)
        self.frame = frame
        if self.follows_animation and not self.is_asked and self.rest is not None:  # the solver is set up
            if self.frames is None:
                self.frames = self.new_frames(request)
            self.frames.ask(frame, self.requested)
            self.is_asked = True

    @property
    def swings(self):
        """Whether what is asked for has secondary motion."""
        return self.requested is not None and self.requested.body is not None

    def new_frames(self, request):
        if request.body is None:
            return SolvedFrames(self.twin, low_priority=has_window())
        return SimulatedFrames(self.twin, self.start, self.fps, low_priority=has_window())

    def wait_for_frame(self, seconds):
        """Until the frame at hand is solved, so many seconds at most; None: however long that takes."""
        if self.follows_animation:
            self.take(self.requested, self.frame)
        if self.follows_animation and self.frames is not None:
            self.frames.wait(self.frame, self.requested, seconds)

    def of_frame(self, shape):
        """The frame's own shape, where it is solved and not yet shown, in place of what the worker has."""
        if not self.follows_animation or self.frames is None:
            return shape
        exact = self.frames.get(self.frame, self.requested)
        if exact is None:
            return shape
        shape, self.exact = None if exact is self.exact else exact, exact
        return shape

    def show_frame(self, context):
        """Shows a frame that is solved already, or one of secondary motion, which is waited for."""
        if self.frames is None and not self.swings:
            return
        self.look(context)
        if self.swings:
            self.wait_for_frame(PATIENCE)
        self.show()

    def stop_frames(self):
        if self.frames is not None:
            self.frames.stop()


def scene_frame(scene):
    """The scene's frame, with its part beyond the whole one, as all frames are told apart."""
    return round(scene.frame_current + scene.frame_subframe, 4)
