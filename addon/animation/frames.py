# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames to bake, and the queue that passes their requests from the main thread to the worker."""

import contextlib
import queue
from dataclasses import dataclass
from math import ceil, floor

from ..blender.actions import pace
from ..core.errors import UserError
from ..core.runtime.jobs import JobCancelled
from ..solver import frame_range

NOISE = 1e-3  # rounding error of a keyframe's position, in frames


@dataclass(frozen=True)
class Frames:
    """Sample i is that of frame start + i · step."""

    start: float
    step: float
    count: int

    def __iter__(self):
        return (self.start + i * self.step for i in range(self.count))

    @property
    def last(self):
        return self.start + (self.count - 1) * self.step

    def with_those_before(self, start):
        """The frames and all whole ones from `start` to the last, in order."""
        last = int(self.last)
        return sorted({*self, *map(float, range(min(start, last), last + 1))})


def choose(context, sources, values):
    """The Frames to bake: `sources` are (object, kind), `values` the settings by name.

    `start` and `end` override the range if they are given.
    """
    scene, which = context.scene, values["range"]
    first, last = values.get("start"), values.get("end")
    if first is None or last is None:
        span = animation(scene, sources) if which == "HANDLES" else frame_range.scene_range(scene)
        first, last = span[0] if first is None else first, span[1] if last is None else last
    if last < first:
        raise UserError("The last frame, {last}, comes before the first, {first}", first=first, last=last)
    step = values["step"] / values["subframes"]
    return Frames(float(first), step, int((last - first) / step + 1e-9) + 1)


def animation(scene, sources):
    """(first, last) scene frame of the animation of the sources and of what moves them."""
    spans = [span for span in (frame_range.animation_range(*one) for one in sources) if span is not None]
    if not spans:
        names = ", ".join(source.name for source, _ in sources)
        raise UserError("Nothing that moves {names} is animated; choose another range", names=names)
    ends = [end / pace(scene) for end in (min(first for first, _ in spans), max(last for _, last in spans))]
    return floor(ends[0] + NOISE), ceil(ends[1] - NOISE)


@contextlib.contextmanager
def playing(scene):
    """Context manager: yields a function that sets the scene's frame; restores the frame at the end."""
    present = scene.frame_current, scene.frame_subframe
    try:
        yield lambda frame: scene.frame_set(int(frame // 1), subframe=frame - frame // 1)
    finally:
        with contextlib.suppress(ReferenceError):  # another file was loaded
            scene.frame_set(present[0], subframe=present[1])


class FrameFeed:
    """Queue of the requests of each frame, in order, with a limit of frames read ahead of the worker."""

    PATIENCE = 0.05  # seconds between checks whether the job was cancelled

    def __init__(self, ahead):
        self._frames, self._is_closed = queue.Queue(ahead), False

    @property
    def is_full(self):
        return self._frames.full()

    def put(self, frame):
        self._frames.put_nowait(frame)

    def close(self):
        """Called when the main thread has put the last frame, or was stopped."""
        self._is_closed = True

    def take(self, task):
        """The next frame; JobCancelled if the task is cancelled first, or if the feed is closed and empty."""
        while self._frames.empty() and not task.cancelled and not self._is_closed:
            with contextlib.suppress(queue.Empty):
                return self._frames.get(timeout=self.PATIENCE)
        try:
            return self._frames.get_nowait()
        except queue.Empty:
            raise JobCancelled from None
