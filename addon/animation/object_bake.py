# SPDX-License-Identifier: GPL-3.0-or-later
"""One object's bake: its solver, the store of its frames, shared parts, loops, and what plays them."""

import functools
import hashlib
import json
import time
from dataclasses import replace

import numpy as np

from ..blender import mesh_arrays
from ..blender.evaluation import varies
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..blender.references import takes_references
from ..core.errors import UserError, as_user_error
from ..field_modifier import layers
from ..handles import empties
from ..live import sessions
from ..results import placement
from ..solver import contact, secondary_motion
from ..solver.frame_solver import FrameSolver, sampled
from ..solver.secondary_motion import Moment, Poses, Simulation
from ..solver.source_reader import SourceChanged, SourceReader, has_motion_before
from .caches import CacheFile, ShapeKeys, cache_beside, keys_weight, size_text
from .carried_bake import CarriedBake

# Bakes of looping secondary motion, whose last frame equals the first.

ROUNDS = 12  # most passes through the animation
# Largest distance of the last frame from the first, as a share of the size. The remaining gap is distributed
# over the frames; it is comparable to the error of a single step.
CLOSED = 2e-3


def solve(solver, simulation, frames, keep, task=None):
    """Simulates the frames, [(frame, request, whether it is baked)], in rounds until the motion repeats; then
    passes each baked shape to `keep`. UserError if it does not repeat. Holds all shapes in memory."""
    start, request, _ = frames[0]
    simulation.start = int(start)
    first = simulation.shape(solver, start, request, task)
    size = np.ptp(first.points, axis=0).max()
    repeats = comes_back(request, frames[-1][1], CLOSED * size)
    for _ in range(ROUNDS if repeats else 0):
        shapes = [first]
        for frame, asked, _ in frames[1:]:
            shapes.append(simulation.shape(solver, frame, asked, task))
        first, left = shapes[-1], shapes[0].points - shapes[-1].points
        simulation.moments = {int(start): Moment(solver.solver.motion_state, request.motion, True)}
        if np.abs(left).max() < CLOSED * size:
            break
    else:
        raise UserError(
            "The last frame does not come back to the first; loop the animation, or raise Damping"
        )
    for (frame, _, is_baked), shape in zip(frames, shapes, strict=True):
        if is_baked:
            share = np.float32((frame - start) / max(frames[-1][0] - start, 1.0))
            keep(replace(shape, points=shape.points + share * left))


def comes_back(first, last, near):
    """Whether the handles and the object end where they started."""
    pairs = list(zip(first.targets, last.targets, strict=True))
    if first.motion is not None and last.motion is not None:
        pairs.append((first.motion.world, last.motion.world))
    return all(np.allclose(one, other, rtol=0.0, atol=near) for one, other in pairs)


# Bakes shared by several processes. Each solves a part of the frames and stores them beside the cache; the
# one that completes them writes the cache. Frames of a killed process stay for the next one.


class SharedCache(CacheFile):
    """`part` is (i, n), the i-th of n, 1 ≤ i ≤ n; `missing`: number of frames not solved yet."""

    def __init__(self, path, frames, fps, part):
        super().__init__(path, frames, fps)
        self.part, self.missing, self._began = part, 0, time.time()
        self._store, self._points, self._places, self._digested = None, 0, [], (None, b"")

    def open(self, solver):
        from arapfields import __version__
        from arapfields.cli.frames import FrameStore

        setup, region, surface = solver.sampled.setup, solver.sampled.region, solver.sampled.setup.surface
        common = [__version__, setup.kind, surface.exact, surface.fit.options, setup.cells]
        content = repr(common).encode() + surface.vertices.tobytes() + surface.triangles.tobytes()
        content += solver.rest.tobytes() + b"".join(handle_bytes(handle) for handle in setup.handles)
        if region is not None:
            content += region.tobytes()
        self._points = len(solver.rest)
        self._folder.make()
        self._store = FrameStore(self.path, self._points, content)

    def add_request(self, solver, request):
        """Solves a frame if it belongs to this part and is not stored yet."""
        number, parts = self.part
        index = len(self._places)
        place = self._store.place(index, self._key(request))
        self._places.append(place)
        if index % parts == number - 1 and not self._store.has(place):
            self._store.put(place, solver.solve_from_rest(request).points)

    def _key(self, request):
        """Arrays that identify a request."""
        if self._digested[0] is not request.points:
            digest = hashlib.blake2b(request.points.tobytes(), digest_size=16).digest()
            self._digested = request.points, digest
        further = repr([request.style_key, sorted(request.energy.items())]).encode()
        digest = hashlib.blake2b(further + self._digested[1], digest_size=16).digest()
        return [*request.targets, np.frombuffer(digest, np.uint8)]

    def finish(self):
        """Makes the cache once all of its frames are solved."""
        with self._store.alone():
            self.missing = sum(not self._store.has(place) for place in self._places)
            if self.missing and self.path.exists() and self.path.stat().st_mtime > self._began:
                self.missing = 0  # another process has written it meanwhile
            elif not self.missing:
                self.open_for(self._points)
                for place in self._places:
                    self.add(self._store.get(place))
                self._writer.commit()
                self._store.remove(self._places)

    def commit(self):
        """Does nothing: `finish` has committed the cache on the worker."""


def handle_bytes(handle):
    """Bytes that identify a handle at rest."""
    parts = [handle.kind, handle.weight, handle.rest, getattr(handle, "weights", None)]
    return b"".join(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode() for part in parts)


# One object's bake: its solver, the store of its frames, and the modifier or keys that play them.

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
        is_in_place = placement.in_place(settings.output, settings.result) and path is not None
        self.in_place = is_in_place and takes_references(source)  # a linked object would lose its modifier
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
            solve(self.solver, self.simulation, self.looped, self.keep, task)
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
                self.carried.warnings += layers.unmoved_modifiers(item)
        player = source if self.in_place else self.new_object(context, source, self.mesh(context, source))
        placement.show_alone(source, player)
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
            return placement.surface_mesh(source, solver.to_local(solver.rest), solver.sampled.topology)
        return placement.shown_mesh(context, source, len(solver.rest))

    def new_object(self, context, source, mesh):
        report = {"frames": self.frames.count}
        return placement.show(context, source, "BAKE", "BAKE", mesh, report)

    def place_keys(self, context, source):
        item = self.new_object(context, source, self.store.item.data)
        self.store.forget()
        context.scene.frame_set(context.scene.frame_current)  # else the last key stays on
        placement.show_alone(source, item)
        return translated(
            "{count} frames baked into shape keys of {size}",
            count=self.frames.count,
            size=size_text(keys_weight(len(self.solver.rest), self.frames.count)),
        )
