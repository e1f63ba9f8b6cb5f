# SPDX-License-Identifier: GPL-3.0-or-later
"""One object's bake: its solver, the store of its frames, and the modifier or keys that play them."""

import functools
import json

from ..blender import mesh_arrays
from ..blender.actions import varies
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..core.errors import UserError, as_user_error
from ..field_modifier import unseen
from ..handles import empties
from ..live import sessions
from ..results import placement, result_objects, visibility
from ..solver import contact, secondary_motion
from ..solver.frame_solver import FrameSolver
from ..solver.setup import sampled
from ..solver.simulation import Poses, Simulation
from ..solver.source_reader import SourceChanged, SourceReader, has_motion_before
from . import loops
from .caches import CacheFile, ShapeKeys, cache_beside, keys_weight, size_text
from .carried_bake import CarriedBake
from .parts import SharedCache

STYLE_PATH = "arapfields.stylize"  # data path of a style's F-curves


def kind_of(source, kind):
    """DEFORM or STYLIZE: what to bake of a source; chosen by its settings if `kind` is AUTO."""
    settings = settings_of(source)
    if kind != "AUTO":
        return kind
    if settings.live_kind:
        return settings.live_kind
    has_handles = bool(empties.used(source))
    styled = settings.stylize.use_handles if has_handles else varies(source, STYLE_PATH)
    return "STYLIZE" if styled else "DEFORM"


class ObjectBake:
    """Made and placed on the main thread; prepared and solved on the worker.

    `path`: the cache's; None for shape keys.
    `part`: (i, n) if n processes share the frames.
    """

    def __init__(self, context, source, kind, frames, path=None, part=None, loop=False):
        settings, fps = settings_of(source), secondary_motion.frame_rate(context.scene)
        self.in_place = placement.in_place(settings.output, settings.result) and path is not None
        self.poses, self.reader = Poses(), SourceReader(context, source, kind, self.in_place)
        if not self.in_place and settings.output == "WARP":  # unlike live mode, a bake needs all
            self.reader.moves_by_itself = has_motion_before(source, in_place=False)
        self.frames, self.solver, self.error, self.obstacles = frames, None, None, contact.lasting(source)
        beside = None if path is None else functools.partial(cache_beside, path)
        self.carried = CarriedBake(self.reader.carrying, frames, beside, fps, is_shared=part is not None)
        self.simulation = (
            Simulation(settings.secondary.start, fps) if secondary_motion.is_used(source) else None
        )
        self.looped = [] if loop and self.simulation is not None else None  # frames to solve in `finish`
        if path is None:
            self.store = ShapeKeys()
        elif part is None:
            self.store = CacheFile(path, frames, fps)
        elif self.simulation is None:
            self.store = SharedCache(path, frames, fps, part)
        else:
            raise UserError("{name}: secondary motion is not baked in parts; bake it whole", source)

    @property
    def reference(self):
        return self.reader.reference

    @property
    def name(self):
        return self.reference.name

    def request(self, context):
        """The Request at the scene's frame, or the error that ends this object's bake."""
        try:
            source = self.reference.get()
            if contact.lasting(source) != self.obstacles:
                raise SourceChanged(source.name)
            if self.reader.moves_by_itself:
                self.reader.read_points(context, source)
            self.reader.carrying.expect_motion()
            self.reader.refresh_carried(context)
            return self.reader.request(context)
        except (UserError, ValueError) as error:
            return error

    def prepare(self):
        self.solver = FrameSolver(sampled(self.reader.setup), self.reader.carrying)
        self.carried.prepare()
        self.store.open(self.solver)

    def add(self, frame, request, is_baked=True, task=None):
        """Solves and stores one frame; one that is not baked is only simulated for later ones."""
        if isinstance(request, Exception):
            raise request
        if isinstance(self.store, SharedCache):
            self.store.add_request(self.solver, request)
            return
        if self.looped is not None:
            self.looped += [(frame, request, is_baked)] if frame >= self.frames.start else []
            return
        if self.simulation is not None:
            shape = self.simulation.shape(self.solver, frame, request)
        elif is_baked:
            shape = self.poses.shape(self.solver, request, task)
        if is_baked:
            self.keep(shape)

    def keep(self, shape):
        self.carried.add(shape.carried)
        self.store.add(shape.points)

    def attempt(self, call, *given):
        """Calls a part of the work; an error ends this object's bake alone."""
        if self.error is not None:
            return
        try:
            call(*given)
        except MemoryError:
            self.error = UserError("Not enough memory for these settings")
        except (UserError, ValueError, OSError) as error:
            self.error = as_user_error(error)
        if self.error is not None:
            self.discard()

    def finish(self, task):
        if self.looped is not None:
            loops.solve(self.solver, self.simulation, self.looped, self.keep, task)
        self.carried.finish()
        self.store.finish()

    def discard(self):
        """Removes frames that were not placed; the cache of an earlier bake stays."""
        self.store.discard()
        self.carried.discard()

    def ready(self, context, job):
        """Coroutine: the slow part of placing, which the user may cancel, as no data are changed yet."""
        source = self.unchanged_source()
        yield from self.carried.read_keyframes(context, source, job)
        if isinstance(self.store, ShapeKeys):
            yield from self.store.make(self.mesh(context, source), self.frames, job)

    def place(self, context):
        """Coroutine: commits the caches and adds what plays them; returns the line to report."""
        source = self.unchanged_source()
        place = self.place_keys if isinstance(self.store, ShapeKeys) else self.place_cache
        line = place(context, source)
        if self.carried.carrying.objects:
            sessions.end(context, source)
            yield from self.carried.place(context, source)
        return line

    def place_cache(self, context, source):
        file, frames, points = self.store.path, self.frames, len(self.solver.rest)
        missing = getattr(self.store, "missing", 0)
        if missing:
            return translated(
                "{missing} of {count} frames to come: who solves the last one makes {path}",
                missing=missing,
                count=frames.count,
                path=file.name,
            )
        self.store.commit()
        sessions.end(context, source)  # the bake replaces the live shape
        if self.in_place:
            carried = [one.reference.find() for one in self.carried.carrying.objects]
            for item in (source, *(one for one in carried if one is not None and one.type == "MESH")):
                self.carried.warnings += unseen.standing(item)
        player = source if self.in_place else self.new_object(context, source, self.mesh(context, source))
        visibility.show_alone(source, player)
        self.store.play_on(player)
        digest, faces = mesh_arrays.fingerprint(player.data)
        record = {"mesh": digest.hex(), "faces": faces, "start": frames.start, "step": frames.step}
        record |= {"points": points, "frames": frames.count, "count": len(player.data.vertices)}
        settings_of(player).bake.record = json.dumps(record)
        return translated(
            "{count} frames of {points} points baked into {path} ({size})",
            count=frames.count,
            points=f"{points:,}",
            path=file.name,
            size=size_text(file.stat().st_size),
        )

    def unchanged_source(self):
        source = self.reference.get()
        if mesh_arrays.fingerprint(source.data) != self.reader.fingerprint:
            raise SourceChanged(source.name)
        return source

    def mesh(self, context, source):
        """The mesh of a new object, for a bake that does not play on the source itself."""
        solver = self.solver
        if solver.sampled.topology is not None:
            return result_objects.surface_mesh(source, solver.to_local(solver.rest), solver.sampled.topology)
        return result_objects.shown_mesh(context, source, len(solver.rest))

    def new_object(self, context, source, mesh):
        report = {"frames": self.frames.count}
        return result_objects.show(context, source, "BAKE", "BAKE", mesh, report)

    def place_keys(self, context, source):
        item = self.new_object(context, source, self.store.item.data)
        self.store.forget()
        context.scene.frame_set(context.scene.frame_current)  # else the last key stays on
        visibility.show_alone(source, item)
        return translated(
            "{count} frames baked into shape keys of {size}",
            count=self.frames.count,
            size=size_text(keys_weight(len(self.solver.rest), self.frames.count)),
        )
