# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode: while handles move or a style's sliders change, shapes follow; off, all is as it was.

A tool or script makes an object live with begin(context, source), has it look and show the newest shape with
update(context) (in a window a timer does; `wait` seconds for the shape to follow), and ends it with
end(context, source), or end(context, source, keep=True) where the shape shall stay.
"""

import contextlib
import functools
import time

import bpy

from ..blender import timers
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..blender.redraw import redraw
from ..core.errors import UserError
from ..core.runtime import jobs
from ..field_modifier import motion
from ..handles import empties, movers
from . import leftovers
from .animated import scene_range
from .following import scene_frame
from .session import Changed, Session
from .setup import moves

INTERVAL = 1 / 60  # seconds between looks
WAIT = 30.0  # seconds at most that a script waits for the first shape


class Sessions(dict):
    """{session_uid of the source: Session} of all that is live."""

    is_rendering = False  # then frames are followed one by one, and nothing else

    def clear(self):
        """Ends every one and takes its shape away."""
        self.is_rendering = False
        for uid in list(self):
            session = self.pop(uid)
            session.stop()
            take_away(session)


live = Sessions()


def is_live(source, kind=None):
    session = live.get(source.session_uid) if source is not None else None
    return session is not None and kind in (None, session.kind)


def begin(context, source, kind="DEFORM", keeps=False):
    """Makes the source live; UserError when that cannot be. The shape appears when the worker has it.

    `keeps`: what is shown stays when live mode ends.
    """
    earlier = live.pop(source.session_uid, None)
    if earlier is not None:
        earlier.stop()
    session = None
    try:
        session = Session(context, source, kind, earlier=earlier, keeps=keeps)
        session.advance()  # a small mesh is read at once
        tell(session)
    except UserError:
        if session or earlier:
            take_away(session or earlier)
        raise
    live[source.session_uid] = session
    timers.start(poll_live, persistent=True)


def end(context, source, keep=False):
    """Ends live mode: the source looks as before; or the shape stays (`keep`), and its object is returned."""
    session = live.pop(source.session_uid, None)
    if session is None:
        return None
    session.stop()
    session.show_last()
    if keep:
        return session.display.keep(context, source, session.kind)
    session.take_away(source)
    return None


def stop_all():
    """Ends every worker; what is in the file stays as it is."""
    live.is_rendering = False
    while live:
        live.popitem()[1].stop()


def update(context, wait=0.0, refined=False):
    """Looks at every live source once, waiting at most so many seconds for the shapes to follow."""
    for uid, session in list(live.items()):
        try:
            session.look(context)
            if wait:
                session.wait(wait, refined)
            session.show()
            tell(session)
        except Changed:
            restart(context, uid, session)
        except (UserError, ValueError, ReferenceError) as error:
            give_up(uid, session, error)


def tell(session):
    """Names the carried objects that are left out."""
    for reason in session.carrying.take_warnings():
        jobs.add_message("WARNING", f"{session.source.name}: {translated(reason)}")


def give_up(uid, session, error):
    live.pop(uid, None)
    session.stop()
    told = translated("{error}; live mode ended", error=translated(error))
    jobs.add_message("ERROR", f"{session.source.name}: {told}")
    take_away(session)


def take_away(session):
    """Takes the live shape away, also where an undone step left the source or the shape in no scene."""
    with contextlib.suppress(UserError, ReferenceError, AttributeError):
        session.take_away(session.source.find())


def watch(depsgraph):
    """Looks through what Blender has just updated for edits of live sources, and motion before the field."""
    if not live:
        return
    updated = [(u.id.original, u.is_updated_geometry) for u in depsgraph.updates]
    meshes = {item.session_uid for item, shape in updated if shape and isinstance(item, bpy.types.Mesh)}
    objects = {item.session_uid for item, shape in updated if shape and isinstance(item, bpy.types.Object)}
    data = {item.session_uid for item, _ in updated if not isinstance(item, bpy.types.Object)}
    for session in live.values():
        session.carrying.watch(objects, data)
        source = session.source.find()
        if source is None:
            continue
        if source.data.session_uid in meshes:
            session.may_be_edited |= source.session_uid not in motion.written
            session.edited_at = time.monotonic()
        elif session.moves_by_itself and any(moves(item, source) for item, _ in updated):
            session.may_have_moved = True


def restart(context, uid, session):
    """The source or its handles changed: the solver is set up anew, the shape stays where it is."""
    source = session.source.get()
    try:
        begin(context, source, session.kind, session.keeps)
    except UserError as error:
        jobs.add_message("ERROR", f"{source.name}: {translated(error)}")


def poll_live():
    """Called between redraws; ends when nothing is live."""
    if not live:
        return None
    if not live.is_rendering:
        update(bpy.context)
        for session in live.values():
            if session.frames is not None and session.frames.has_news:
                session.frames.has_news = False
                redraw(bpy.context, "UI")
    return INTERVAL


def solved_frames(source, scene):
    """(how many of the scene's frames live mode has solved, how many there are); None where none is."""
    session = live.get(source.session_uid)
    if session is None or session.frames is None:
        return None
    first, last = scene_range(scene)
    return session.frames.count(first, last), last - first + 1


def follow_frame(depsgraph):
    """Shows every live shape as it is at the frame that is about to be rendered."""
    for uid, session in list(live.items()):
        try:
            source = session.source.get()
            if session.worker is None or source.mode != "OBJECT":
                continue
            if session.moves_by_itself:
                session.read_points(bpy.context, source)
            warn_of_hidden(source, session, depsgraph)
            seen = source.evaluated_get(depsgraph)
            where = functools.partial(rendered_matrix, depsgraph=depsgraph)
            request = session.current_request(bpy.context, source, where, seen, depsgraph)
            session.take(request, scene_frame(depsgraph.scene))
            session.worker.wait(WAIT, refined=True)
            session.wait_for_frame(None)  # a picture of another frame would be none
            session.show()
        except Changed:
            continue
        except (UserError, ValueError, ReferenceError) as error:
            give_up(uid, session, error)


def show_frame():
    """Shows what is known at the frame that the scene has come to, in the same picture."""
    for session in list(live.values()):
        with contextlib.suppress(Changed, UserError, ValueError, ReferenceError):  # the timer tells
            session.show_frame(bpy.context)


def warn_of_hidden(source, session, depsgraph):
    """Says once which handles a render does not see, and so cannot follow."""
    there = {item.original.session_uid for item in depsgraph.ids}
    used = empties.used(source)
    hidden = [movers.name_of(e) for e in used if movers.mover_of(e).session_uid not in there]
    if hidden and session.handles:
        text = translated(
            "{names} is hidden in renders, which therefore do not follow it", names=", ".join(hidden)
        )
        message = "WARNING", f"{source.name}: {text}"
        if message not in jobs.messages():
            jobs.add_message(*message)


def rendered_matrix(item, bone="", *, depsgraph):
    return empties.matrix_of(item.original.evaluated_get(depsgraph), bone)


def recover(leave=leftovers.clear):
    """After a load or an undone step: ends what no session or no source knows as live any more.

    `leave(source)` deals with one that is said to be live, and is not.
    """
    for uid, session in list(live.items()):
        source = session.source.find()
        if source is None or not settings_of(source).live_kind:
            live.pop(uid)
            session.stop()
            if not session.display.in_place:
                take_away(session)
        else:
            session.restored()  # what it wrote may have been undone
    for source in bpy.data.objects:
        if settings_of(source).live_kind and not is_live(source):
            with contextlib.suppress(UserError, RuntimeError, AttributeError):
                leave(source)
                settings_of(source).live_kind = ""
