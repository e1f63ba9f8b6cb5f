# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode: shapes follow handles and a style's sliders; its end restores the earlier state.

A tool or script makes an object live with begin(context, source), has it show the newest shape with
update(context) (in a window a timer does), and ends it with end(context, source, keep).
"""

import contextlib

import bpy

from ..blender import host, modifier_stack, property_definitions, references
from ..blender.evaluation import depsgraph_of, updated
from ..blender.host import redraw
from ..blender.language import about
from ..blender.object_references import in_scene, settings_of
from ..core.errors import UserError
from ..core.runtime import jobs
from ..field_modifier import layers
from ..results import placement
from ..solver.frame_range import involved
from ..solver.source_reader import SourceChanged, uses_handles
from .live_modifier import Kept
from .playback import scene_frame
from .session import Session, Updates


class ShownScene:
    """The window's scene and its frame.

    Each scene has a depsgraph of its own, and Blender copies evaluated transforms to the original objects
    only from the active one: after a switch they are still those of the scene before, and after a jump to a
    frame, until the window evaluates it, those of the frame before. `uid`: session_uid of the scene at the
    last check; None before the first one.
    """

    uid = None

    def follow(self, context, sessions):
        """After a switch of scenes, tags and evaluates the objects that live shapes follow; evaluates a frame
        that the scene was set to, if the window has not done so yet."""
        before, self.uid = self.uid, context.scene.session_uid
        if before in (None, self.uid):
            if sessions and scene_frame(depsgraph_of(context).scene_eval) != scene_frame(context.scene):
                updated(context.view_layer)
            return
        for session in sessions:
            source = session.source.find()
            for item in () if source is None else involved(source, session.kind):
                item.update_tag(refresh={"TIME"} if isinstance(item, bpy.types.Object) else set())
            session.edits.may_have_moved = session.reader.moves_by_itself
        updated(context.view_layer)


INTERVAL = 1 / 60  # seconds between calls of the timer
WAIT = 30.0  # seconds at most that a script waits for the first shape


class Sessions(dict):
    """{session_uid of the source: Session} of all that is live."""

    is_rendering = False  # during renders, sessions follow changes of frame only
    begun = None  # session_uid of a source whose session is being made

    def __init__(self):
        # {number of a session that has ended: Former}; Blender undoes up to 256 steps.
        self.past = Kept(lambda former: former.display.arrays)
        self.shown_scene = ShownScene()
        self.returning = {}  # {session_uid of a source: Former}, to be restarted after undo
        self.held = set()  # session_uids in `returning` whose shape then stays until a handle moves
        # session_uids of sources that are live in the step that was undone to, but cannot be now: the step is
        # left as it is, since what is wrong there is mended by a further undo, or by a change of what the
        # shape follows.
        self.paused = set()

    def part_with(self, uid):
        """Stops a session, which undo may restart; returns it, or None."""
        session = self.pop(uid, None)
        if session is not None:
            session.stop()
            self.past.keep(session.number, session.former)
        return session

    def clear(self):
        """Ends every session and removes its shape."""
        self.is_rendering = False
        self.past.clear()
        self.returning.clear()
        self.held.clear()
        self.paused.clear()
        for uid in list(self):
            session = self.pop(uid)
            session.stop()
            take_away(session)


live = Sessions()


def is_live(source, kind=None):
    session = live.get(source.session_uid) if source is not None else None
    return session is not None and kind in (None, session.kind)


def begin(context, source, kind="DEFORM", keeps_shape=False, way=None, goes_back=False):
    """Makes the source live, or raises UserError. The shape appears once the worker has solved it.

    `keeps_shape`: what is shown stays when live mode ends. `way`: of layers.make_way(), if that is done.
    `goes_back`: after an error the caller restarts the session that this one replaces; its display stays.
    """
    live.shown_scene.follow(context, live.values())
    end_for_kind(context, source, kind)
    live.begun = source.session_uid
    earlier, session = live.part_with(source.session_uid), None
    returned = None if earlier else live.returning.pop(source.session_uid, None)
    former = earlier.former if earlier else returned
    waits = source.session_uid in live.paused
    live.paused.discard(source.session_uid)
    if former is None or settings_of(source).live_kind != kind:
        settings_of(source).held = ""
    if way is None:
        way = layers.make_way(source, kind) if former is None else former.way
    try:
        session = Session(context, source, kind, former, keeps_shape, way)
        session.advance()  # a small mesh is read at once
        warn(session)
    except UserError:
        if returned is not None:
            pause(source.session_uid)
            live.past.keep(settings_of(source).live_number, returned)
        elif (session or earlier) and not (earlier and goes_back):
            take_away(session or earlier)
        else:
            layers.put_back(context, source, way)
            live.paused |= {source.session_uid} if waits else set()
        raise
    finally:
        live.begun = None
    session.is_back = returned is not None
    session.is_held = (earlier is not None and earlier.is_held) or source.session_uid in live.held
    live.held.discard(source.session_uid)
    if session.display.in_place:
        layers.note(source, kind)
    live[source.session_uid] = session
    host.start(poll_live, persistent=True)


def end_for_kind(context, source, kind):
    """Ends a session of another kind if one of both kinds acts on the other's result; returns (Former, kind)
    of the ended session, or None."""
    session = live.get(source.session_uid)
    if session is None or session.kind == kind or not session.display.in_place:
        return None
    stays = layers.stays_below(source, kind) and settings_of(source).result == "MODIFIER"
    if not stays and not modifier_stack.layers(source):
        return None
    former = session.former
    end(context, source, keep=stays)
    return former, session.kind


def go_back(context, source, former, kind):
    """Restarts a session that end_for_kind() or one of another kind has ended."""
    if not former.display.is_there():
        former = former._replace(display=None)
    live.returning[source.session_uid] = former
    try:
        begin(context, source, kind, former.keeps_shape)
    except UserError as error:
        jobs.add_message("ERROR", about(source.name, error), {source.session_uid})


def follows_handles(source):
    """Whether the source is live, and its shape follows handles."""
    session = live.get(source.session_uid)
    return session is not None and uses_handles(settings_of(source), session.kind)


def end(context, source, keep=False):
    """Ends live mode: the source looks as before; or the shape stays (`keep`), and its object is returned."""
    session = live.get(source.session_uid)
    if session is None:
        forget_paused(source)
        return None
    if keep or session.keeps_shape:
        with contextlib.suppress(UserError, ValueError, ReferenceError):
            session.settle(WAIT)
    live.part_with(source.session_uid)
    if keep:
        return session.display.keep(context, source, session.kind)
    session.take_away(source)
    layers.uncover(source, baked=True)
    return None


def forget_paused(source):
    """Ends the live state that the file or a step of undo has, without a session; returns whether there was
    one."""
    live.paused.discard(source.session_uid)
    if not settings_of(source).live_kind:  # any write tags the object as updated
        return False
    settings_of(source).live_kind = ""
    return True


def end_for_job(context, source, output, result):
    """Ends live mode before a job with that output and result; True if the source was live.

    If the job's result goes to the same modifier, the live shape stays until the job has ended, also if it
    fails; otherwise the source's state from before live mode is restored.
    """
    session = live.get(source.session_uid)
    if session is None:
        return forget_paused(source)
    stays = session.display.in_place and settings_of(source).result == result
    end(context, source, keep=stays and placement.keeps_mesh(output, result))
    context.view_layer.update()
    return True


def stop_all():
    """Stops every worker; does not change the file's data."""
    live.is_rendering = False
    live.past.clear()
    live.returning.clear()
    live.held.clear()
    live.paused.clear()
    while live:
        live.popitem()[1].stop()


def update(context, wait=0.0, refined=False):
    """Updates every session once; waits at most `wait` seconds for each shape."""
    return_all(context)
    live.shown_scene.follow(context, live.values())
    if any([update_one(context, uid, wait, refined) for uid in list(live)]):
        references.push("Live")


def update_one(context, uid, wait=0.0, refined=False, shared=None):
    """The same for one session, without a step of undo; returns whether its end has changed the scene.
    `shared`: the display of the session that goes on after an error, which stays."""
    for _ in range(2):  # a session that is set up anew with a held shape has it at once
        session = live[uid]
        try:
            session.update(context)
            if wait:
                session.wait(wait, refined)
            session.is_back = not session.show() and session.is_back
            warn(session)
            return False
        except SourceChanged:
            with references.between():
                if not restart(context, uid, session):
                    return True
        except (UserError, ValueError, ReferenceError) as error:
            return end_with_error(uid, session, error, stays=session.display is shared)
        if not live[uid].is_held:
            break
    return False


def settle(context, uid):
    """Shows the source's shape for its present handles, solved from rest."""
    for _ in range(2):  # the first update may set the solver up anew
        update(context, WAIT)
        if uid in live:
            with contextlib.suppress(SourceChanged):
                return live[uid].settle(WAIT)


def warn(session):
    """Names the carried objects that are left out."""
    for reason in session.carrying.take_warnings():
        jobs.add_message("WARNING", about(session.source.name, reason), {session.source.uid})


def end_with_error(uid, session, error, stays=False):
    """Ends a session and reports the error; undo may restart it. A deleted source is left as it is, one that
    undo has just brought back, and a display that `stays`. Returns whether the scene has changed."""
    source = session.source.find()
    live.part_with(uid)
    is_there = not session.display.in_place or source is None or in_scene(source)
    changes = is_there and not session.is_back and not stays
    if changes:
        take_away(session)
    elif session.is_back:
        pause(uid)
    text = about(session.source.name, UserError("{error}; live mode ended", error=error))
    jobs.add_message("ERROR", text, {session.source.uid})
    return changes


def take_away(session):
    """Removes the live shape, even if undo has unlinked the source or the shape from all scenes."""
    with contextlib.suppress(UserError, ReferenceError, AttributeError), references.unused_kept():
        session.take_away(session.source.find())


def watch(depsgraph):
    """Passes a depsgraph's updates to every session, to detect edits and motion before the field."""
    if live:
        updates = Updates.of(depsgraph)
        for session in live.values():
            session.edits.note(updates)
    if live.paused:
        try_again({update.id.original.session_uid for update in depsgraph.updates})


def pause(uid):
    """Has a source that is live in the file wait for a change. What its trial itself has changed is none."""
    if not live.is_rendering:
        bpy.context.view_layer.update()
    live.paused.add(uid)


def try_again(changed):
    """Has the paused sources restarted whose shapes follow one of these data-blocks (session_uids)."""
    for source in [one for one in bpy.data.objects if one.session_uid in live.paused]:
        kind = settings_of(source).live_kind
        former = live.past.get(settings_of(source).live_number)
        is_there = kind and former is not None and former.display.is_there()
        if is_there and any(item.session_uid in changed for item in involved(source, kind)):
            live.returning[source.session_uid] = former
            host.start(poll_live, persistent=True)


def follow_place(settings):
    """Update callback of what the result is made of and where it goes: a live shape goes there at once, in
    the step of undo of that change."""
    session = live.get(settings.id_data.session_uid)
    if session is not None and session.display.in_place != settings.in_place:
        restart(bpy.context, settings.id_data.session_uid, session)


property_definitions.listeners["place"] = follow_place


def renew(context, source):
    """The same after what else is shown by new data: the source carries another object."""
    session = live.get(source.session_uid)
    if session is not None:
        restart(context, source.session_uid, session)


def restart(context, uid, session):
    """Sets the solver up anew after an edit of the source or its handles; the shape stays on display. Returns
    whether that was possible."""
    source = session.source.get()
    try:
        begin(context, source, session.kind, session.keeps_shape)
    except UserError as error:
        text = about(source.name, UserError("{error}; live mode ended", error=error))
        jobs.add_message("ERROR", text, {source.session_uid})
        return False
    return True


def return_all(context):
    """Restarts the sessions that undo has put into `live.returning`."""
    for source in [one for one in live.returning and bpy.data.objects if one.session_uid in live.returning]:
        former, kind = live.returning[source.session_uid], settings_of(source).live_kind
        try:
            with references.between():
                begin(context, source, kind, former.keeps_shape)
        except UserError as error:
            message = "ERROR", about(source.name, error)
            if message not in jobs.messages():  # it may be tried often
                jobs.add_message(*message, {source.session_uid})
    live.returning.clear()


def poll_live():
    """Timer callback; unregisters itself when nothing is live."""
    if not live and not live.returning:
        return None
    if not live.is_rendering:
        update(bpy.context)
        if any([session.playback.take_news() for session in live.values()]):
            redraw(bpy.context, "UI")
    return INTERVAL
