# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes of several objects in one pass over the frames: the main thread plays the scene and reads requests,
the worker solves them and writes the shapes. Few requests are in memory at once."""

import contextlib

from ..blender.language import about, translated
from ..core.errors import UserError
from ..core.runtime.coroutines import Pause
from ..core.runtime.jobs import Item
from ..core.runtime.progress import JobCancelled
from .frames import FrameFeed, playing

AHEAD = 8  # most frames read ahead of the worker, if each request has point positions of its own


class BakePass:
    """The bakes (object_bake.ObjectBake), all of the same frames.

    Requests with handles only are small: all frames are then played at once, and the scene is back at its
    frame while the worker solves.
    """

    def __init__(self, bakes, frames):
        self.bakes, self.frames, self.failed = bakes, frames, []
        starts = [bake.simulation.start for bake in bakes if bake.simulation is not None]
        self.played = frames.with_those_before(min(starts)) if starts else list(frames)
        moving = any(bake.reader.moves_by_itself or bake.reader.carrying.objects for bake in bakes)
        self.feed = FrameFeed(AHEAD if moving else len(self.played))

    def item(self, context, job, failures):
        names = ", ".join(bake.name for bake in self.bakes)
        return Item(names, self.work, lambda _: self.place(context, job, failures))

    def play(self, context, job):
        """Coroutine that plays the frames and queues the requests of each; restores the frame at the end."""
        with contextlib.closing(self.feed), playing(context.scene) as show:
            for frame in self.played:
                while self.feed.is_full and not job.done:
                    yield Pause.WORKER
                if job.done:  # cancelled, or every object failed
                    return
                show(frame)
                self.feed.put([bake.request(context) for bake in self.bakes])
                yield Pause.REDRAW

    def work(self, tracker):
        """Solves and stores all frames; on the worker."""
        count, baked = len(self.played), set(self.frames)
        try:
            for bake in self.bakes:
                bake.attempt(bake.prepare)
            for number, frame in enumerate(self.played):
                text = translated("frame {frame}", frame=f"{frame:g}")
                task = tracker.start(text, 1 / (count - number))
                requests = self.feed.take(task)
                for bake, request in zip(self.bakes, requests, strict=True):
                    if task.cancelled:
                        raise JobCancelled
                    bake.attempt(bake.add, frame, request, frame in baked, task)
                if all(bake.error is not None for bake in self.bakes):
                    break
            for bake in self.bakes:
                bake.attempt(bake.finish, task)
        except BaseException:
            self.discard()
            raise

    def place(self, context, job, failures):
        """Coroutine: once all bakes are ready, puts caches and keys in place; returns the line to report."""
        lines = []
        for bake in self.bakes:
            yield from self.unless_it_fails(bake, bake.ready(context, job), failures)
        for bake in self.bakes:
            line = yield from self.unless_it_fails(bake, bake.place(context), failures)
            if line is not None:
                lines.append(line)
                failures += [about(bake.name, reason) for reason in bake.carried.warnings]
        if not lines:
            raise UserError("{error}", error=failures.pop())
        return ", ".join(lines)

    def unless_it_fails(self, bake, coroutine, failures):
        """Coroutine: the result of `coroutine`; None if the bake has failed, which is reported once."""
        if bake not in self.failed:
            try:
                if bake.error is not None:
                    raise bake.error
                return (yield from coroutine)
            except (UserError, ValueError) as error:
                self.failed.append(bake)
                failures.append(about(bake.name, error))
        return None

    def discard(self):
        """Removes caches that are not in place."""
        for bake in self.bakes:
            bake.discard()

    def discard_keys(self):
        """Removes shape keys that are not in place; on the main thread."""
        for bake in self.bakes:
            bake.store.discard_item()
