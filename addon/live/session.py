# SPDX-License-Identifier: GPL-3.0-or-later
"""One source that is live: its solver, on a thread of its own, and where its shape is shown."""

import contextlib

import bpy

from ..blender import mesh_arrays, vertex_groups
from ..blender.host import has_window
from ..blender.object_references import ObjectReference, settings_of
from ..blender.property_definitions import from_single_precision
from ..carried.carrying import Carrying
from ..carried.world_matrices import depsgraph_of
from ..core.errors import UserError
from ..core.geometry.spaces import space_of
from ..core.runtime import native
from ..core.runtime.coroutines import run_to_completion, step_for
from ..core.runtime.latest_request_worker import REST, LatestRequestWorker
from ..field_modifier import motion
from ..handles import empties
from ..results import placement, visibility
from ..stylize import preference
from ..surface.source_surface import read_surface
from . import body
from .animated import frame_range
from .edits import Changed, Edits
from .following import Following, scene_frame
from .live_modifier import PAUSING, LiveModifier
from .live_object import LiveObject
from .request import Request
from .setup import differ_in_handles, energy_weights, has_motion_before, layout_of
from .swinging import PACE
from .warm import warm

PREVIEW_CELLS = 96  # at most, of the implicit surface that is shown while it moves


class Session(Edits, Following):
    """Reads its source when made, on the main thread; everything that takes time is done by the worker.

    `shown`: whether there is something to be seen of it, which goes on from that of an `earlier` session.
    `in_place`: whether it works on the shape at the modifier's place; None: where it is shown there.
    `keeps`: what it shows is the user's work, which stays: bit for bit until a handle moves, and at the end.
    """

    def __init__(
        self,
        context,
        source,
        kind="DEFORM",
        shown=True,
        follow=True,
        earlier=None,
        keeps=False,
        in_place=None,
    ):
        self.keeps, self.quiet, self.is_restored, self.edited_at = keeps, False, False, 0.0
        settings = settings_of(source)
        self.source, self.kind = ObjectReference(source), kind
        self.layout = layout_of(source, kind, context.scene)
        self.output = settings.output
        if in_place is None:
            in_place = shown and placement.in_place(self.output, settings.target)
        context.view_layer.update()
        self.carrying, self.riding = Carrying(context, source), []
        self.surface = read_surface(context, source, in_place, carrying=self.carrying)
        self.moves_by_itself = in_place and has_motion_before(source)
        self.fingerprint = mesh_arrays.fingerprint(source.data)
        self.may_be_edited = self.may_have_moved = False
        self.cells = min(settings.resolution, PREVIEW_CELLS)
        self.handles, self.weights = [], None
        self.start, self.fps = settings.secondary.start, body.frame_rate(context.scene)
        self.energy = energy_weights(settings, kind)
        self.requested = self.solver = self.samples = self.topology = self.style_set = None
        self.placed = (
            self.surface.local
        )  # (n, 3) the source's points where the modifiers before have them now
        self.points = self.rest = (
            None  # (n, 3) those that the solver moves, in local coordinates and solve space
        )
        self.worker, self.display = None, earlier.display if shown and earlier else None
        if keeps or frame_range(source, kind) is None:
            self.frame = scene_frame(context.scene)
        if shown:
            self.show_on(context, source, in_place)
            self.carrying.bind(context, earlier.carrying.before if earlier else None)
            settings.live_kind = kind
        self.reading = self.read(context, follow)

    def ready_solver(self):
        extras = self.surface.solids or any(part is not None for part in self.surface.stiffness)
        if self.kind != "DEFORM" or not self.surface.in_place or extras:
            return None
        return warm.take(self.surface, self.energy)

    def show_on(self, context, source, in_place):
        """Shows the shape where that belongs; what a session before made is used again, or goes."""
        if self.display is not None and self.display.in_place and in_place:
            self.display.bind(context, source)
            return
        if self.display is not None:
            self.display.take_away(source)
        self.display = (LiveModifier if in_place else LiveObject)(context, source, self.surface)

    def read(self, context, follow=False):
        """Coroutine (core/coroutines.py) that reads the vertex groups; then the worker sets out."""
        source = self.source.get()
        style = settings_of(source).stylize if self.kind == "STYLIZE" else None
        names = preference.group_names(source, style) if style else empties.group_names(source)
        names = [*names, *body.group_names(source)]
        in_place = self.surface.in_place
        weights = yield from vertex_groups.read_weights(context, source, names, in_place)
        source = self.source.get()
        for name in body.group_names(source):
            self.masses = weights[name]
        if style is None or settings_of(source).stylize.use_handles:
            self.handles = empties.solve_handles(source, self.surface.space, weights)
        if style is not None:
            style = settings_of(source).stylize
            self.weights = preference.region_weights(context, source, style, weights, in_place)
        if follow:
            self.worker = LatestRequestWorker(
                self.moved,
                self.prepare,
                self.refined,
                rest=PACE if body.is_body(source) else REST,
                low_priority=has_window(),
            )

    def advance(self):
        """Reads on for a moment; whether the worker has set out."""
        if self.worker is None:
            step_for(self.reading)
        return self.worker is not None

    def wait(self, seconds, refined):
        """Until the worker has reached the newest request, so many seconds at most."""
        if self.worker is None:
            run_to_completion(self.reading)
        self.look(bpy.context)
        self.worker.wait(seconds, refined)
        if refined or self.swings:
            self.wait_for_frame(seconds)

    def stop(self):
        self.reading.close()
        self.stop_frames()
        if self.worker is not None:
            self.worker.stop()

    def look(self, context):
        """Sends what is asked for to the worker when it changed."""
        if not self.advance():
            return
        source = self.source.get()
        self.display.require(source)
        if source.mode in PAUSING:  # it goes on from what the user leaves
            self.may_be_edited = True
            return
        if self.is_restored:
            context.view_layer.update()
        layout = layout_of(source, self.kind, context.scene)
        if layout != self.layout:
            if not differ_in_handles(layout, self.layout):
                raise Changed
            self.layout, self.handles = layout, empties.solve_handles(source, self.surface.space)
        if self.is_edited(source):
            raise Changed
        if self.may_have_moved:
            self.read_points(context, source)
        self.refresh_carried(context)
        self.take(self.current_request(context, source), scene_frame(context.scene))
        if self.is_restored:
            self.is_restored, self.quiet = False, True
            self.display.before = motion.snapshot(source)
            self.carrying.renew()

    def restored(self):
        """What the source and its handles are now came from elsewhere: an undone step, a cancelled drag.

        The solver goes there too, but shows nothing until a handle moves.
        """
        if self.keeps:
            self.is_restored = self.quiet = True
        else:
            self.requested = None

    def current_request(self, context, source, where=empties.matrix_of, seen=None, depsgraph=None):
        """The Request of what the handles and settings are now.

        `where(object, bone)` is the world matrix of one, and `seen` the source, as a render's `depsgraph` has
        them for instance.
        """
        space, settings = space_of(where(source), source.name), settings_of(seen or source).stylize
        energy, targets = energy_weights(settings_of(seen or source), self.kind), []
        swings = body.body_of(settings_of(seen or source), space)
        if self.handles:
            current = empties.solve_handles(source, space, where=where)
            targets = [h.target[:3, 3] if h.kind == "POINT" else h.target for h in current]
        frames = self.carrying.poses(space, depsgraph or depsgraph_of(context))
        if self.kind != "STYLIZE":
            return Request(targets, None, self.placed, self.handles, energy, frames, swings)
        style = preference.requested_style(settings, space, where=where)
        strength, sharpness = (
            from_single_precision(settings.strength),
            from_single_precision(settings.sharpness),
        )
        directions = style.directions(native.library())
        key = (*style.key(), strength, sharpness)
        further = key, directions, strength, sharpness, style.up
        return Request(targets, further, self.placed, self.handles, energy, frames, swings)

    def show(self):
        """Shows the newest shape; True when there was one."""
        shape, error = self.worker.poll() if self.worker is not None else (None, "")
        if error:
            raise UserError(error)
        shape = self.of_frame(shape)
        if shape is None or self.quiet:
            return False
        shown = self.display.show(self.source.get(), shape)
        if shown:
            self.carrying.show(shape.carried)
        return shown

    def take_away(self, source):
        """Everything looks as it did before; `source` is None where it is gone."""
        if self.keeps and source is not None:
            visibility.forget(source)
        self.display.take_away(source)
        self.carrying.take_away()

    def show_last(self):
        """What the worker made before it ended; an error of it no longer matters."""
        with contextlib.suppress(UserError, ReferenceError):
            self.show()
