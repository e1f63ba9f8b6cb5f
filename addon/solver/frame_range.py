# SPDX-License-Identifier: GPL-3.0-or-later
"""Ranges of frames: of the scene, of an animation and of a bake, and the queue of a bake's requests."""

import contextlib
import queue
from dataclasses import dataclass
from math import ceil, floor

import bpy

from ..blender.evaluation import pace
from ..blender.object_references import settings_of
from ..blender.references import parts_of, references
from ..core.errors import UserError
from ..core.runtime.jobs import JobCancelled
from ..handles import empties, movers
from .contact import listed

# Frame range of the animation of a source's handles, style or target.


def animation_range(source, kind):
    """(first, last) frame of the animation of the source, its handles, style or target; None without
    animation."""
    ranges = [span for item in involved(source, kind) for span in ranges_of(item)]
    return (min(first for first, _ in ranges), max(last for _, last in ranges)) if ranges else None


def scene_range(scene):
    """(first, last) frame of the scene, or of its preview range if that is on."""
    if scene.use_preview_range:
        return scene.frame_preview_start, scene.frame_preview_end
    return scene.frame_start, scene.frame_end


def involved(source, kind):
    """The data-blocks whose animation a source's shape follows, with their dependencies; each once."""
    settings = settings_of(source)
    used, style = [source], settings.stylize
    if kind == "WRAP":
        used.append(settings.wrap.onto)
    if kind == "DEFORM" or (kind == "STYLIZE" and style.use_handles):
        used += [movers.mover_of(entry) for entry in empties.used(source)]
    if kind == "STYLIZE":
        used += [style.frame_object, style.style_object]
    if kind != "WRAP" and settings.contact.use:
        used += [item for entry in settings.contact.obstacle_list for item in listed(entry)]
    found = {}
    while used:
        one = used.pop()
        if one is None or one in found:
            continue
        found[one] = None
        used += [getattr(one, name, None) for name in ("parent", "data", "shape_keys")]
        used += [item for part in parts_of(one) for item in read_by(part)]
    return list(found)


def read_by(part):
    """The objects that a modifier or constraint reads, or the data-block that a driver's variable reads."""
    kind = bpy.types.ID if isinstance(part, bpy.types.DriverTarget) else bpy.types.Object
    return [value for _, value in references(part) if isinstance(value, kind)]


def ranges_of(item):
    """(first, last) frame of each action and unmuted NLA strip of a data-block."""
    data = getattr(item, "animation_data", None)
    if data is None:
        return
    if data.action is not None:
        yield tuple(data.action.frame_range)
    for track in data.nla_tracks:
        for strip in track.strips:
            if not track.mute and not strip.mute:
                yield strip.frame_start, strip.frame_end


# The frames to bake, and the queue that passes their requests from the main thread to the worker.

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


def choose_frames(context, sources, values):
    """The Frames to bake: `sources` are (object, kind), `values` the settings by name.

    `start` and `end` override the range if they are given.
    """
    scene, which = context.scene, values["range"]
    first, last = values.get("start"), values.get("end")
    if first is None or last is None:
        span = animation_span(scene, sources) if which == "HANDLES" else scene_range(scene)
        first, last = span[0] if first is None else first, span[1] if last is None else last
    if last < first:
        raise UserError("The last frame, {last}, comes before the first, {first}", first=first, last=last)
    step = values["step"] / values["subframes"]
    return Frames(float(first), step, int((last - first) / step + 1e-9) + 1)


def animation_span(scene, sources):
    """(first, last) scene frame of the animation of the sources and of what moves them."""
    spans = [span for span in (animation_range(*one) for one in sources) if span is not None]
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
