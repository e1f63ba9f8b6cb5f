# SPDX-License-Identifier: GPL-3.0-or-later
"""One live drag of a handle, from press to release; cancelling restores everything bit for bit."""

from mathutils import Matrix, Vector

from ..blender import modifier_stack, references
from ..blender.language import translated
from ..blender.object_references import ObjectReference, settings_of
from ..carried import carrying
from ..core.runtime import jobs
from ..field_modifier import layers, motion
from ..handles import keyframes
from ..live import live_modifier, sessions
from . import pins

SHAPE_WAIT = 0.25  # most seconds that a redraw waits for the shape
TRANSFORMS = ("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale")


class Snapshot:
    """The state that a drag changes, read before the pin is placed. The last arguments are make_way()'s."""

    def __init__(self, context, source, referred, ended, way):
        self.referred, self.ended, self.way = referred, ended, way
        settings, layer = settings_of(source), context.view_layer
        self.source, session = ObjectReference(source), sessions.live.get(source.session_uid)
        self.live = None if session is None else (session.kind, session.keeps_shape)
        self.mark = live_modifier.mark(source)
        self.is_settled = session is None or session.is_current(context)
        self.motion = motion.snapshot(source)
        self.row = settings.active_handle
        self.active = ObjectReference(layer.objects.active) if layer.objects.active else None
        self.selected = [ObjectReference(item) for item in context.selected_objects]

    def restore_selection(self, context):
        """Restores the selection and the active object."""
        for item in context.selected_objects:
            item.select_set(False)
        for reference in self.selected:
            item = reference.find()
            if item is not None:
                item.select_set(True)
        context.view_layer.objects.active = self.active.find() if self.active else None

    def push_new(self):
        """A step of undo for new data that live mode has made and that stay."""
        references.push_new("Live", carrying.with_carried(self.source.get()), self.referred)

    def restore_shape(self, context, is_held):
        """Restores the shape and informs the session. `is_held`: it stays until a handle moves."""
        source = self.source.get()
        if self.motion is None:
            modifier = modifier_stack.find(source)
            motion.write_to(motion.carrier(source, modifier), motion.Motion(None))
        else:
            motion.restore(source, self.motion)
        live_modifier.put_mark(source, self.mark)
        if sessions.is_live(source):  # else it has ended with an error, shown in the panel
            sessions.live[source.session_uid].restored(is_held)
            sessions.update(context)


class Drag:
    """A drag of a handle's Empty. `is_new`: the pin was placed by the same press."""

    is_released = False  # whether the button is up, and the shape settles

    def __init__(self, context, before, empty, is_new=False):
        self.before, self.is_new, self.has_moved = before, is_new, False
        self.empty, self.start = ObjectReference(empty), empty.matrix_world.copy()
        self.reach, self.kind = pins.entry_of(empty).reach, pins.entry_of(empty).kind
        self.values = {name: tuple(getattr(empty, name)) for name in TRANSFORMS}
        source = before.source.get()
        begin_live(context, source, before.way)
        sessions.live[source.session_uid].keeps_shape = True

    def move(self, context, location):
        """Moves the Empty to a location (3,) in world space."""
        matrix = self.empty.get().matrix_world.copy()
        matrix.translation = Vector(location)
        self.put(context, matrix)

    def turn(self, context, axis, angle):
        """Rotates the Empty from its orientation at the start, about an axis (3,) through it."""
        entry = pins.entry_of(self.empty.get())
        if not entry.hold_turn:
            entry.hold_turn = True
            self.start = self.empty.get().matrix_world.copy()
        middle = self.start.translation
        turn = Matrix.Translation(middle) @ Matrix.Rotation(angle, 4, Vector(axis))
        self.put(context, turn @ Matrix.Translation(-middle) @ self.start)

    def put(self, context, matrix):
        """Moves the Empty, and waits up to SHAPE_WAIT for the shape, to draw both in the same frame."""
        session = self.session()
        self.empty.get().matrix_world = matrix
        sessions.update(context)
        if session is not None and session.worker is not None:
            session.worker.wait_for_result(SHAPE_WAIT)
            sessions.update(context)
        self.has_moved = True

    def change_reach(self, context, steps):
        """Increases the handle's reach by steps of the mouse wheel; negative ones decrease it."""
        entry = pins.entry_of(self.empty.get())
        entry.reach = pins.next_reach(self.before.source.get(), entry, steps)
        self.has_moved = True
        sessions.update(context)

    def session(self):
        return sessions.live.get(self.before.source.uid)

    def is_settled(self):
        """Whether the session has solved and refined the newest request."""
        session = self.session()
        return session is None or (session.worker is not None and session.worker.is_settled)

    def end(self, context):
        """Keeps the shape on display; a press without a move does not change it."""
        session = self.session()
        if not self.has_moved:
            self.before.restore_shape(context, is_held=self.before.is_settled)
        elif session is not None:
            sessions.settle(context, self.before.source.uid)
            insert_keys(context, self.empty.get())

    def cancel(self, context):
        """Restores the state before the press, bit for bit."""
        source, empty = self.before.source.get(), self.empty.find()
        if self.is_new and empty is not None:
            pins.discard(source, empty)
        elif empty is not None:
            for name, value in self.values.items():
                setattr(empty, name, value)
            pins.entry_of(empty).reach, pins.entry_of(empty).kind = self.reach, self.kind
        settings_of(source).active_handle = self.before.row
        self.before.restore_selection(context)
        session = self.session()
        if session is not None and self.before.live:
            kind, session.keeps_shape = self.before.live
            if session.kind != kind:
                sessions.begin(context, source, kind, session.keeps_shape)
            self.before.restore_shape(context, is_held=False)
        elif session is not None:
            session.keeps_shape = False
            sessions.end(context, source)
        if self.before.ended is not None:
            sessions.go_back(context, source, *self.before.ended)
        self.before.push_new()


def insert_keys(context, empty):
    """Keyframes the handle if Auto Keying is on."""
    if context.scene.tool_settings.use_keyframe_insert_auto:
        keyframes.insert(pins.entry_of(empty))


def begin_live(context, source, way=None):
    """Makes a source live, unless its shape follows handles already."""
    if not sessions.follows_handles(source):
        sessions.begin(context, source, kind_of(source), keeps_shape=True, way=way)


def kind_of(source):
    """The kind of session for a drag: STYLIZE if the source's motion is a style with handles."""
    posed = settings_of(source).moved_by == layers.POSED and settings_of(source).stylize.use_handles
    return "STYLIZE" if posed else "DEFORM"


def make_way(context, source):
    """layers.make_way() before a drag. Returns what modifiers referred to before, (Former, kind) of the
    session that it has ended, and the Way; None for each that is not there."""
    referred = references.referred(carrying.with_carried(source))
    ended = way = None
    if not sessions.follows_handles(source):
        ended = sessions.end_for_kind(context, source, kind_of(source))
        reason = layers.replaced(source, kind_of(source))
        if reason is not None:
            jobs.add_message("WARNING", translated(reason), {source.session_uid})
        way = layers.make_way(source, kind_of(source))
    return referred, ended, way


def of_entry(context, source, entry):
    """A drag of an existing handle."""
    before = Snapshot(context, source, *make_way(context, source))
    pins.choose(context, entry.empty)
    return Drag(context, before, entry.empty)


def of_new_pin(context, source, location, radius, **further):
    """A drag of a new pin."""
    before = Snapshot(context, source, *make_way(context, source))
    entry = pins.place(context, source, location, radius, **further)
    try:
        return Drag(context, before, entry.empty, is_new=True)
    except Exception:
        pins.discard(source, entry.empty)
        before.restore_selection(context)
        before.push_new()
        raise
