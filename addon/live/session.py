# SPDX-License-Identifier: GPL-3.0-or-later
"""One source that is live: its requests, the worker that solves them, and where the shape is shown."""

import itertools
import time
from collections import deque
from typing import NamedTuple

import bpy

from ..blender.host import has_window, redraw
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..core.runtime.jobs import run_to_completion, step_for
from ..core.runtime.threads import REST, LatestRequestWorker
from ..field_modifier import layers, unseen
from ..results import placement, visibility
from ..solver import secondary_motion, style_settings
from ..solver.frame_range import animation_range
from ..solver.frame_solver import Shape
from ..solver.request import Request
from ..solver.source_reader import SourceChanged, SourceReader
from . import stored
from .edits import EditWatch, differ_in_handles, layout_of
from .live_modifier import PAUSING, Former, display_of
from .live_solver import PACE, LiveSolver
from .playback import Playback, scene_frame

REMEMBERED = 8  # number of shapes at rest that a cancelled move may return to
PATIENCE = 1.0  # seconds at most that playback waits for a frame of secondary motion
numbers = itertools.count(int(time.time()) % 10**9)  # of sessions; unlike those of an earlier process


class AtRest(NamedTuple):
    """A shape solved from rest, and its request; `shape` is None where the file had it."""

    request: Request
    shape: Shape | None


class Session:
    """Reads its source in the constructor, on the main thread; the worker solves.

    `earlier`: Former of the source's last session, whose display is reused. `keeps_shape`: the shape is the
    user's work and stays when live mode ends. `way`: what layers.make_way() has changed for the session.

    If the shape in the file belongs to the current request (stored.py), as after undo, it stays bit for bit.
    Otherwise it was stored before the solve had ended, and the request is solved.
    """

    def __init__(self, context, source, kind="DEFORM", earlier=None, keeps_shape=False, way=layers.NOTHING):
        settings = settings_of(source)
        in_place = placement.in_place(settings.output, settings.result)
        self.keeps_shape, self.way, self.kind = keeps_shape, way, kind
        self.layout = layout_of(source, kind, context.scene)
        self.reader = SourceReader(context, source, kind, in_place)
        self.edits, self.solver, self.worker = EditWatch(self.reader), LiveSolver(self.reader), None
        is_still = keeps_shape or animation_range(source, kind) is None
        self.playback = Playback(self.solver, scene_frame(context.scene) if is_still else None)
        self.requested = None  # the newest Request
        self.at_rest = deque(maxlen=REMEMBERED)  # of AtRest: the last shapes on display that were at rest
        self.touching = None  # (k, 3) contact points of the shape on display, in local coordinates
        self.is_restored = earlier is not None  # whether the shape in the file may be the current request's
        self.is_held = False  # whether that shape counts as the request's without a comparison
        self.is_back = False  # whether undo has brought it back, and it has not shown a shape since
        self.is_quiet = False  # whether solved shapes stay hidden until a handle moves
        self.display = display_of(context, source, self.reader.surface, earlier)
        self.carrying.bind(context, earlier.carried if earlier else None)
        self.number = next(numbers)
        settings.live_kind, settings.live_number = kind, self.number
        if earlier is None and self.display.in_place:
            stored.put_mark(source, stored.UNSETTLED)
            self.carrying.warnings += unseen.reasons(source)
        self._reading = self._start(context)

    @property
    def source(self):
        return self.reader.reference

    @property
    def carrying(self):
        return self.reader.carrying

    def _start(self, context):
        """Coroutine (core/runtime/jobs.py) that reads the vertex groups, then starts the worker."""
        yield from self.reader.read_setup(context)
        has_motion = secondary_motion.is_used(self.source.get())
        self.worker = LatestRequestWorker(
            self.solver.solve,
            self.solver.prepare,
            self.solver.refine,
            rest=PACE if has_motion else REST,
            low_priority=has_window(),
        )

    def advance(self):
        """Continues to read for a moment, to the end where a shape is to be held, which is said before the
        step of undo; True once the worker is started."""
        if self.worker is None:
            (run_to_completion if self.is_held else step_for)(self._reading)
        return self.worker is not None

    def wait(self, seconds, refined):
        """Waits until the worker has solved the newest request, at most `seconds`."""
        if self.worker is None:
            run_to_completion(self._reading)
        self.update(bpy.context)
        self.worker.wait(seconds, refined)
        if refined or self.has_motion:
            self.playback.wait(self.requested, seconds)

    def settle(self, seconds):
        """Shows and keeps the newest request's shape, solved from rest unless it has secondary motion."""
        self.wait(seconds, refined=not self.has_motion)
        self.show()
        self.keep_shown()

    @property
    def former(self):
        return Former(self.source.uid, self.display, self.carrying.before, self.keeps_shape, self.way)

    def stop(self):
        self._reading.close()
        self.playback.stop()
        if self.worker is not None:
            self.worker.stop()

    @property
    def has_motion(self):
        """Whether the newest request has secondary motion."""
        return self.requested is not None and self.requested.motion is not None

    def update(self, context):
        """Sends a new request to the worker; raises SourceChanged if the solver must be set up anew."""
        if not self.advance():
            return
        source = self.source.get()
        self.display.require(source)
        if source.mode in PAUSING:  # the session continues after the mode ends
            self.edits.may_be_edited = True
            return
        if self.is_restored:
            context.view_layer.update()
        if self.waits(source):
            return
        layout = layout_of(source, self.kind, context.scene)
        if layout != self.layout:
            if not differ_in_handles(layout, self.layout):
                raise SourceChanged(source.name)
            self.layout = layout
            self.reader.read_handles(source)
        self.edits.require_unedited(context, source)
        request = self.reader.request(context)
        if self.is_restored and not self.stays(source, request):
            self.is_restored, self.requested = False, None
        self.set_request(request, scene_frame(context.scene))
        if self.is_restored:
            self.is_restored, self.is_quiet = False, True
            self.at_rest.append(AtRest(request, None))
            self.keep_shown()

    def waits(self, source):
        """Whether the user still has to choose the style's object or handle."""
        return self.kind == "STYLIZE" and style_settings.is_begun(source)

    def stays(self, source, request):
        """Whether the source shows the request's stored shape, recalled from the cache if necessary."""
        if not self.display.in_place:
            return False
        if self.is_held:
            stored.hold(source, self.digest(request))
        self.is_held = False
        return stored.recall(source, self.digest(request))

    def digest(self, request):
        """Hash of a request and the setup; equal for requests of the same shape."""
        setup = self.reader.setup
        surface = setup.surface
        further = surface.space.local_to_solve, surface.stiffness, surface.solids, setup.region, setup.masses
        return request.digest(self.reader.fingerprint, self.layout, *further)

    def is_current(self, context):
        """Whether the shape in the file is the one of the present handles."""
        if self.worker is None:
            return False
        context.view_layer.update()
        source = self.source.get()
        if self.waits(source):
            return stored.mark(source) != stored.UNSETTLED
        if self.is_restored:
            return False
        try:
            now = self.digest(self.reader.request(context))
        except SourceChanged:
            return False
        return stored.mark(source) == stored.wanted(source, now)

    def keep_shown(self):
        """With `keeps_shape`, makes the shape on display the one that stays when live mode ends."""
        if self.keeps_shape and self.display.in_place:
            self.display.keep_shown(self.source.get())
            self.carrying.renew()

    def set_request(self, request, frame):
        """Requests a solve of `request`, which was read at that frame of the scene."""
        is_new = self.requested is None or self.playback.steps_motion(request, frame)
        if is_new or not request.is_like(self.requested):
            self.requested, self.is_quiet = request, self.is_restored
            if self.is_quiet:
                self.touching = None  # of the shape before; solving this request finds its own
            else:
                self.is_quiet = self.go_back(request)
            self.solver.returns = self.is_quiet
            if self.playback.begin(request, frame):
                self.worker.request(request)
        self.playback.advance(self.requested, frame)

    def go_back(self, request):
        """Shows the shape of this request again, bit for bit, if it was at rest: a move of what it follows
        was cancelled. Returns whether that is so; secondary motion swings back instead."""
        if request.motion is not None or self.playback.frames is not None:
            return False
        source = self.source.get()
        known = next((one for one in reversed(self.at_rest) if request.is_like(one.request)), None)
        if known is None:
            return False
        if known.shape is None:
            return self.display.in_place and stored.recall(source, self.digest(request))
        return self.show_shape(source, known.shape)

    def restored(self, is_held=False):
        """Called after undo or a cancelled drag has changed the source and its handles.

        `is_held`: the shape stays as it is until a handle moves.
        """
        self.is_restored = self.is_quiet = True
        self.is_held = is_held

    def show(self):
        """Shows the newest shape, if there is one."""
        shape, error = self.worker.poll() if self.worker is not None else (None, "")
        if error:
            raise UserError(error)
        shape = self.playback.shape(self.requested, otherwise=shape)
        if shape is None:
            return
        source = self.source.get()
        if self.is_quiet:
            if shape.of is not None and stored.mark(source) == self.digest(shape.of):
                self.touching = shape.touching
                redraw(bpy.context, "WINDOW")
        else:
            self.show_shape(source, shape)

    def show_shape(self, source, shape):
        """Shows a shape with what the source carries; returns whether the display could."""
        if not self.display.show(source, shape):
            return False
        self.touching = shape.touching
        self.carrying.show(shape.carried)
        if self.display.in_place:
            stored.note(source, "" if shape.of is None else self.digest(shape.of), shape)
        if shape.of is not None and all(one.shape is not shape for one in self.at_rest):
            self.at_rest.append(AtRest(shape.of, shape))
        return True

    def show_frame(self, context):
        """Shows the current frame if it is solved; with secondary motion, waits up to PATIENCE for it."""
        if self.playback.frames is None and not self.has_motion:
            return
        self.edits.may_have_moved = self.reader.moves_by_itself
        self.update(context)
        if self.has_motion:
            self.playback.wait(self.requested, PATIENCE)
        self.show()

    def take_away(self, source):
        """Restores the state from before live mode; `source` is None if it was deleted."""
        if self.keeps_shape and source is not None:
            visibility.forget(source)
        self.display.take_away(source)
        self.carrying.take_away()
        if source is not None:
            layers.put_back(bpy.context, source, self.way)
