# SPDX-License-Identifier: GPL-3.0-or-later
"""One live session: its requests, and edits of its source, handles and carried objects."""

import itertools
import time
from collections import deque
from typing import NamedTuple

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import is_animated
from ..blender.host import has_window, redraw
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..core.geometry.spaces import SAME_STRETCH
from ..core.runtime.jobs import run_to_completion, step_for
from ..core.runtime.threads import REST, LatestRequestWorker
from ..field_modifier import field_nodes, layers, motion
from ..handles import empties, movers, symmetry
from ..handles.empties import matrix_of
from ..results import placement
from ..solver import secondary_motion, style_settings
from ..solver.frame_range import animation_range
from ..solver.frame_solver import Request, Shape
from ..solver.source_reader import SourceChanged, SourceReader, rest_frame, solve_space, uses_handles
from ..stiffness import painted
from . import live_modifier
from .live_modifier import PAUSING, Former, display_of
from .live_solver import PACE, LiveSolver
from .playback import Playback, scene_frame

# Detects edits of a live session's source, handles and carried objects; main thread.

STROKE = 0.3  # seconds without new weights after which a brush stroke counts as ended
CHECKING = 0.02  # share of the time that is spent at most on looking for edits beside live mode's own changes


class Updates(NamedTuple):
    """Data-blocks updated by a depsgraph, and the session_uids of some of them."""

    items: list  # original data-blocks; objects only with an updated transform or geometry
    meshes: set  # with new geometry
    objects: set  # with new geometry
    data: set  # all data-blocks that are no objects

    @classmethod
    def of(cls, depsgraph):
        moved = [
            update
            for update in depsgraph.updates
            if update.is_updated_geometry
            or update.is_updated_transform
            or not isinstance(update.id, bpy.types.Object)
        ]
        items = [update.id.original for update in moved]
        shapes = [update.id.original for update in depsgraph.updates if update.is_updated_geometry]
        return cls(
            items,
            {item.session_uid for item in shapes if isinstance(item, bpy.types.Mesh | bpy.types.PointCloud)},
            {item.session_uid for item in shapes if isinstance(item, bpy.types.Object)},
            {item.session_uid for item in items if not isinstance(item, bpy.types.Object)},
        )


class EditWatch:
    """Records depsgraph updates; `require_unedited` then compares the source with what was read."""

    def __init__(self, reader):
        self.reader, self.may_be_edited, self.may_have_moved, self.edited_at = reader, False, False, 0.0
        self.may_hide_edit = False  # whether an update was of live mode's own change, and perhaps of an edit
        self.next_check = 0.0  # when to look for such an edit
        self.world = None  # the source's world matrix at the last check

    def note(self, updates):
        """Records the Updates of a depsgraph."""
        self.reader.carrying.watch(updates.objects, updates.data)
        source = self.reader.reference.find()
        if source is None:
            return
        has_new_shape = source.data.session_uid in updates.meshes
        if has_new_shape:
            if source.session_uid in motion.written:
                self.may_hide_edit = True
            else:
                self.may_be_edited = True
            self.edited_at = time.monotonic()
        items = [item for item in updates.items if item != source or not has_new_shape]
        if self.reader.moves_by_itself and any(may_move(item, source) for item in items):
            self.may_have_moved = True

    def require_unedited(self, context, source):
        """Raises SourceChanged if the mesh or its non-uniform scale has changed; else reads moved points."""
        if not is_animated(source) and self.is_stretched(source):
            raise SourceChanged(source.name)
        begin = time.monotonic()
        is_due = self.may_be_edited or (self.may_hide_edit and begin >= self.next_check)
        if is_due and not self.is_in_stroke(source):
            self.may_be_edited = self.may_hide_edit = False
            if self.is_edited(context, source):
                raise SourceChanged(source.name)
            self.next_check = begin + (time.monotonic() - begin) / CHECKING
        if self.may_have_moved:
            self.may_have_moved = False
            self.reader.read_points(context, source)
        self.reader.refresh_carried(context)

    def is_stretched(self, source):
        """Whether the non-uniform scale differs from that at reading: exactly, if the matrix equals the last
        check's; by more than SAME_STRETCH while the source moves."""
        world = matrix_of(source)
        rests, self.world = np.array_equal(world, self.world), world
        now = solve_space(source, world, self.reader.kind)
        return not now.is_like(self.reader.surface.space, 0.0 if rests else SAME_STRETCH)

    def is_in_stroke(self, source):
        return source.mode == "WEIGHT_PAINT" and time.monotonic() - self.edited_at < STROKE

    def is_edited(self, context, source):
        surface = self.reader.surface
        if source.mode == "WEIGHT_PAINT":  # between two strokes
            return not painted.same(painted.read(context, source, surface.in_place), surface.stiffness)
        return mesh_arrays.fingerprint(source.data) != self.reader.fingerprint


def may_move(item, source):
    """Whether an update of a data-block may move the source's points before its field modifier."""
    if isinstance(item, bpy.types.Object):
        return item == source or (item.type != "EMPTY" or settings_of(item).handle_of != source)
    return isinstance(item, bpy.types.Key | bpy.types.Armature | bpy.types.Lattice | bpy.types.Curve)


def layout_of(source, kind, scene):
    """Comparable settings that a solver is set up for: handles with their rest poses, output, modifiers.

    After a change, the solver is set up anew. Energy weights are left out, as they may be animated.
    """
    settings = settings_of(source)
    held = [
        (movers.key_of(e), e.kind, movers.group_of(e), tuple(movers.user_settings(e).values()), tuple(e.rest))
        for e in empties.used(source)
    ]
    style, stiffness = settings.stylize, settings.stiffness
    further = (settings.output, settings.result, settings.surface)
    further += (stiffness.group, stiffness.times, stiffness.bend_group, stiffness.bend_times)
    if kind == "STYLIZE":
        further += (style.region, style.region_material, style.use_handles, style.samples, style.seed)
    further += tuple((e.item.session_uid if e.item else 0, e.way) for e in settings.carried)
    further += (secondary_motion.layout_of(source, scene), field_nodes.of(source) is not None)
    further += (rest_frame(source, kind, settings.in_place),)
    if kind == "DEFORM":
        further += (symmetry.offset_of(source),)
    used = uses_handles(settings, kind)
    return (held if used else [], used and empties.kept_rest(source), further, stack_of(source))


def differ_in_handles(a, b):
    """Whether two layouts differ in handles alone, and the solver can take those of `a` as it is."""
    return a[2:] == b[2:] and bool(a[0]) and bool(b[0]) and not any(group for _, _, group, *_ in a[0])


def stack_of(source):
    """The modifiers before the field's, and whether the mesh has several users."""
    before = modifier_stack.before(source, in_place=True)
    shown = [(modifier.name, modifier.type, modifier.show_viewport) for modifier in before]
    return shown, source.data.users > 1


# One source that is live: its requests, the worker that solves them, and where the shape is shown.

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
            live_modifier.put_mark(source, live_modifier.UNSETTLED)
            self.carrying.warnings += layers.reasons_unseen(source)
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
            live_modifier.hold(source, self.digest(request))
        self.is_held = False
        return live_modifier.recall(source, self.digest(request))

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
            return live_modifier.mark(source) != live_modifier.UNSETTLED
        if self.is_restored:
            return False
        try:
            now = self.digest(self.reader.request(context))
        except SourceChanged:
            return False
        return live_modifier.mark(source) == live_modifier.wanted(source, now)

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
            return self.display.in_place and live_modifier.recall(source, self.digest(request))
        return self.show_shape(source, known.shape)

    def restored(self, is_held=False):
        """Called after undo or a cancelled drag has changed the source and its handles.

        `is_held`: the shape stays as it is until a handle moves.
        """
        self.is_restored = self.is_quiet = True
        self.is_held = is_held

    def show(self):
        """Shows the newest shape; returns whether there is one."""
        shape, error = self.worker.poll() if self.worker is not None else (None, "")
        if error:
            raise UserError(error)
        shape = self.playback.shape(self.requested, otherwise=shape)
        if shape is None:
            return False
        source = self.source.get()
        if self.is_quiet:
            if shape.of is not None and live_modifier.mark(source) == self.digest(shape.of):
                self.touching = shape.touching
                redraw(bpy.context, "WINDOW")
        else:
            self.show_shape(source, shape)
        return True

    def show_shape(self, source, shape):
        """Shows a shape with what the source carries; returns whether the display could."""
        if not self.display.show(source, shape):
            return False
        self.touching = shape.touching
        self.carrying.show(shape.carried)
        if self.display.in_place:
            live_modifier.note(source, "" if shape.of is None else self.digest(shape.of), shape)
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
            placement.keep_visibility(source)
        self.display.take_away(source)
        self.carrying.take_away()
        if source is not None:
            layers.put_back(bpy.context, source, self.way)
