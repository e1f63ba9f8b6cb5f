# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode: while handles move or a style's sliders change, results follow; off, all is as it was."""

import contextlib

import bpy

from ..blender import timers
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..core.runtime import jobs
from ..results import result_objects
from . import live_object
from .session import Changed, Session

INTERVAL = 1 / 60  # seconds between looks at the handles
WAIT = 30.0  # seconds at most that a script waits for the first shape


class Sessions(dict):
    """{session_uid of the source: Session} of all that is live."""

    def clear(self):
        """Ends every one and takes its result away."""
        for uid in list(self):
            session = self.pop(uid)
            session.stop()
            take_away(session)


live = Sessions()


def is_live(source, kind=None):
    session = live.get(source.session_uid) if source is not None else None
    return session is not None and kind in (None, session.kind)


def begin(context, source, kind="DEFORM"):
    """Makes the source live; UserError when that cannot be. The shape appears when the worker has it."""
    if source.session_uid in live:
        live.pop(source.session_uid).stop()
    session = Session(context, source, kind)
    try:
        session.advance()  # a small mesh is read at once
    except UserError:
        live_object.drop(source)
        raise
    live[source.session_uid] = session
    timers.start(poll_live, persistent=True)


def end(context, source, keep=False):
    """Ends live mode: the result goes and the source looks as before; or the result stays (`keep`)."""
    session = live.pop(source.session_uid, None)
    if session is not None:
        session.stop()
        session.show_last()
    if keep:
        return live_object.keep(context, source, session.kind if session else "DEFORM")
    live_object.drop(source)
    return None


def stop_all():
    """Ends every worker; what is in the file stays as it is."""
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
        except Changed:
            restart(context, uid, session)
        except (UserError, ValueError, ReferenceError) as error:
            live.pop(uid, None)
            session.stop()
            told = translated("{error}; live mode ended", error=translated(error))
            jobs.add_message("ERROR", f"{session.source.name}: {told}")
            take_away(session)


def take_away(session):
    """Takes the live object away, also one that an undone step left in the file but in no scene."""
    with contextlib.suppress(UserError, ReferenceError, AttributeError):
        live_object.drop(session.source.find())
    leftover = session.result.find()
    if leftover is not None:
        result_objects.discard(leftover)


def watch(depsgraph):
    """Looks through what Blender has just updated for edits of live sources."""
    if not live:
        return
    meshes = {
        update.id.original.session_uid
        for update in depsgraph.updates
        if update.is_updated_geometry and isinstance(update.id, bpy.types.Mesh)
    }
    for session in live.values() if meshes else ():
        source = session.source.find()
        if source is not None and source.data.session_uid in meshes:
            session.may_be_edited = True


def restart(context, uid, session):
    """The source or its handles changed: the solver is set up anew, the result stays the same object."""
    source = session.source.get()
    try:
        begin(context, source, session.kind)
    except UserError:  # the last handle was removed
        live.pop(uid, None)
        live_object.drop(source)


def poll_live():
    """Called between redraws; ends when nothing is live."""
    if not live:
        return None
    update(bpy.context)
    return INTERVAL


def recover():
    """After a file is loaded or a step undone: takes away live results that no session moves any more."""
    for source in bpy.data.objects:
        if settings_of(source).live_display and not is_live(source):
            with contextlib.suppress(UserError, RuntimeError, AttributeError):
                live_object.drop(source)
