# SPDX-License-Identifier: GPL-3.0-or-later
"""One object's bake: its solver, where its frames go, and what plays them at last."""

import contextlib
import functools
import json
import time

from ..blender import mesh_arrays
from ..blender.language import translated
from ..blender.object_references import ObjectReference, settings_of
from ..core.errors import UserError
from ..core.runtime.coroutines import Pause
from ..field_modifier import cache_modifier
from ..handles import empties
from ..live import animated, body, sessions
from ..live.session import Session
from ..live.simulation import Simulation
from ..results import placement, result_objects, visibility
from .caches import cache_beside, keys_weight, plain, size_text
from .carried_bake import CarriedBake
from .parts import SharedFrames

STYLE_PATH = "arapfields.stylize"  # of what is keyframed of a style


def kind_of(source, kind):
    """DEFORM or STYLIZE: what is baked of a source where AUTO is asked for."""
    settings = settings_of(source)
    if kind != "AUTO":
        return kind
    if settings.live_kind:
        return settings.live_kind
    held = bool(empties.used(source))
    styled = settings.stylize.use_handles if held else animated.has_keys(source, STYLE_PATH)
    return "STYLIZE" if styled else "DEFORM"


class ObjectBake:
    """Made and placed on the main thread; prepared, and given its frames, by the worker.

    `path` is where the cache goes; None for shape keys. `part`: (i, n) where n processes share the frames.
    """

    def __init__(self, context, source, kind, frames, path=None, told="", part=None):
        settings = settings_of(source)
        in_place = placement.in_place(settings.output, settings.target) and path is not None
        self.session = Session(context, source, kind, shown=False, follow=False, in_place=in_place)
        self.reference, self.frames, self.path, self.told = ObjectReference(source), frames, path, told
        self.fps = context.scene.render.fps / context.scene.render.fps_base
        self.in_place, self.error, self.writer, self.shapes = in_place, None, None, []
        beside = None if path is None else functools.partial(cache_beside, path, told)
        self.carried = CarriedBake(
            self.session.carrying, frames, beside, self.fps, is_shared=part is not None
        )
        self.part, self.shared, self.missing, self.begun = part, None, 0, time.time()
        self.simulation = None
        if body.is_body(source):
            if part is not None:
                raise UserError(
                    "{name}: secondary motion is not baked in parts; bake it whole", name=source.name
                )
            self.simulation = Simulation(self.session, self.session.start, self.fps)

    @property
    def name(self):
        return self.reference.name

    def request(self, context):
        """What is asked for at the scene's frame, or the error that ends this object's bake."""
        try:
            source = self.reference.get()
            if self.session.moves_by_itself:
                self.session.read_points(context, source)
            self.session.carrying.expect_motion()
            self.session.refresh_carried(context)
            return self.session.current_request(context, source)
        except (UserError, ValueError) as error:
            return error

    def prepare(self):
        self.session.prepare()
        self.carried.prepare()
        if self.path is not None and self.part is not None:
            self.shared = SharedFrames(self.path, self.session, len(self.session.rest), self.part)
        elif self.path is not None:
            self.writer = self.new_writer()

    def new_writer(self):
        from arapfields.point_cache import PointCacheWriter

        frames, points = self.frames, len(self.session.rest)
        return PointCacheWriter(
            self.path, points, frames.count, start=frames.start, step=frames.step, fps=self.fps
        )

    def add(self, frame, request, wanted=True):
        """Solves one frame and puts it where it goes; one that is not wanted may only lead to others."""
        if isinstance(request, Exception):
            raise request
        if not wanted and self.simulation is None:
            return
        if self.shared is not None:
            self.shared.add(self.session, request)
            return
        if self.simulation is None:
            shape = self.session.solve_from_rest(request)
        else:
            shape = self.simulation.shape(frame, request)
            if not wanted:
                return
        points = shape.points
        self.carried.add(shape.carried)
        if self.writer is not None:
            self.writer.write(points)
        else:
            self.shapes.append(points)

    def attempt(self, call, *given):
        """Does a part of the work; what goes wrong ends this object's bake alone."""
        if self.error is not None:
            return
        try:
            call(*given)
        except MemoryError:
            self.error = UserError("not enough memory for these settings")
        except (UserError, ValueError, OSError) as error:
            self.error = error if isinstance(error, UserError) else UserError("{error}", error=error)
        if self.error is not None:
            self.discard()

    def finish(self):
        self.carried.finish()
        if self.shared is not None:
            with self.shared.alone():
                self.join()
        elif self.writer is not None:
            self.writer.finish()

    def join(self):
        """Makes the cache where all of its frames are there."""
        self.missing = self.shared.missing()
        if self.missing and self.path.exists() and self.path.stat().st_mtime > self.begun:
            self.missing = 0  # another process has made it meanwhile
        elif not self.missing:
            self.writer = self.new_writer()
            for points in self.shared:
                self.writer.write(points)
            self.writer.commit()
            self.shared.remove()

    def discard(self):
        """Removes what was not put in its place; the cache of an earlier bake stays as it is."""
        if self.writer is not None:
            self.writer.discard()
        self.shapes.clear()
        self.carried.discard()

    def place(self, context, job):
        """Coroutine: the caches in their places and what plays them; returns the line to report."""
        source = self.unchanged_source()
        told = yield from self.place_own(context, source, job)
        if self.carried.carrying.objects:
            sessions.end(context, source)
            yield from self.carried.place(context, source, job)
        return told

    def place_own(self, context, source, job):
        if self.path is None:
            return (yield from self.add_keys(context, source, job))
        if self.missing:
            return translated(
                "{missing} of {count} frames to come: who solves the last one makes {path}",
                missing=self.missing,
                count=self.frames.count,
                path=self.path.name,
            )
        if self.shared is None:
            self.commit()
        player = source
        sessions.end(context, source)  # what was live is baked now
        if not self.in_place:
            player = result_objects.show(
                context, source, "BAKE", "BAKE", self.mesh(context, source), {"frames": self.frames.count}
            )
        visibility.show_alone(source, player)
        self.play(player)
        digest, faces = mesh_arrays.fingerprint(player.data)
        record = {"mesh": digest.hex(), "faces": faces, "start": self.frames.start, "step": self.frames.step}
        record |= {"points": len(self.session.rest), "frames": self.frames.count}
        record["count"] = len(player.data.vertices)
        settings_of(player).bake.record = json.dumps(record)
        size = size_text(self.path.stat().st_size)
        return translated(
            "{count} frames of {points} points baked into {path} ({size})",
            count=self.frames.count,
            points=f"{len(self.session.rest):,}",
            path=self.path.name,
            size=size,
        )

    def unchanged_source(self):
        source = self.reference.get()
        if mesh_arrays.fingerprint(source.data) != self.session.fingerprint:
            raise UserError("{name} changed while it was worked on; run again", name=source.name)
        return source

    def commit(self):
        try:
            self.writer.commit()
        except OSError as error:
            raise UserError("{error}", error=error) from error

    def play(self, player):
        """Has an object play the cache."""
        cache_modifier.play(player, self.told, self.frames.start, self.frames.step)

    def mesh(self, context, source):
        """Of an object of its own, where the source's own vertices do not take the motion."""
        session = self.session
        if session.topology is not None:
            return result_objects.surface_mesh(source, session.local(session.rest), session.topology)
        return result_objects.shown_mesh(context, source, len(session.rest))

    def add_keys(self, context, source, job):
        """The object with a shape key a frame; taken away again where the user cancels."""
        report = {"frames": self.frames.count}
        item = result_objects.show(context, source, "BAKE", "BAKE", self.mesh(context, source), report)
        frames, kept = [plain(frame) for frame in self.frames], False
        weight = size_text(keys_weight(len(self.session.rest), len(frames)))
        try:
            for number in range(len(frames)):
                job.report_main_thread(
                    number / len(frames), translated("Storing frame {frame}", frame=frames[number])
                )
                result_objects.add_frame(item, frames, number, self.shapes[number])
                self.shapes[number] = None  # the key has it
                yield Pause.REDRAW
            context.scene.frame_set(context.scene.frame_current)  # else the key stored last stays on
            visibility.show_alone(source, item)
            kept = True
        finally:
            if not kept:
                with contextlib.suppress(ReferenceError):
                    result_objects.discard(item)
        return translated("{count} frames baked into shape keys of {size}", count=len(frames), size=weight)
