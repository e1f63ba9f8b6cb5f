# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode: while handles move or a style's sliders change, shapes follow; off, all is as it was.

A tool or script makes an object live with begin(context, source), has it show the newest shape with
update(context) (in a window a timer does), and ends it with end(context, source, keep).
"""

import contextlib

import bpy

from ..blender import modifier_stack, timers
from ..blender.language import about
from ..blender.object_references import in_scene, settings_of
from ..blender.redraw import redraw
from ..core.errors import UserError
from ..core.runtime import jobs
from ..field_modifier import layers
from ..results import placement
from ..solver.source_reader import SourceChanged, uses_handles
from .edits import Updates
from .session import Session
from .shown_scene import ShownScene
from .stored import Kept

INTERVAL = 1 / 60  # seconds between looks
WAIT = 30.0  # seconds at most that a script waits for the first shape


class Sessions(dict):
    """{session_uid of the source: Session} of all that is live."""

    is_rendering = False  # then frames are followed one by one, and nothing else
    begun = None  # session_uid of a source whose session is being made

    def __init__(self):
        # {number of a session that has ended: Former}; Blender undoes up to 256 steps.
        self.past = Kept(lambda former: former.display.arrays)
        self.shown_scene = ShownScene()
        self.returning = {}  # session_uid of a source: Former, of which an undone step says that it is live

    def part_with(self, uid):
        """Stops a session, which an undone step may bring back; returns it, or None."""
        session = self.pop(uid, None)
        if session is not None:
            session.stop()
            self.past.keep(session.number, session.former)
        return session

    def clear(self):
        """Ends every one and takes its shape away."""
        self.is_rendering = False
        self.past.clear()
        self.returning.clear()
        for uid in list(self):
            session = self.pop(uid)
            session.stop()
            take_away(session)


live = Sessions()


def is_live(source, kind=None):
    session = live.get(source.session_uid) if source is not None else None
    return session is not None and kind in (None, session.kind)


def begin(context, source, kind="DEFORM", keeps_shape=False):
    """Makes the source live; UserError when that cannot be. The shape appears when the worker has it.

    `keeps_shape`: what is shown stays when live mode ends.
    """
    live.shown_scene.follow(context, live.values())
    end_for_kind(context, source, kind)
    live.begun = source.session_uid
    earlier, session = live.part_with(source.session_uid), None
    former = live.returning.pop(source.session_uid, None) if earlier is None else earlier.former
    if former is None or settings_of(source).live_kind != kind:
        settings_of(source).held = ""
    gone = layers.make_way(source, kind) if former is None else former.gone
    try:
        session = Session(context, source, kind, former, keeps_shape, gone)
        session.advance()  # a small mesh is read at once
        warn(session)
    except UserError:
        if session or earlier:
            take_away(session or earlier)
        else:
            layers.put_back(context, source, gone)
        raise
    finally:
        live.begun = None
    if session.display.in_place:
        layers.note(source, kind)
    live[source.session_uid] = session
    timers.start(poll_live, persistent=True)


def end_for_kind(context, source, kind):
    """Ends live mode before a session of another kind where one of both acts on what the other has made;
    returns (Former, kind) of what has ended, or None."""
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
    """Makes the source live again as it was before end_for_kind()."""
    live.returning[source.session_uid] = former
    begin(context, source, kind, former.keeps_shape)


def follows_handles(source):
    """Whether the source is live, and its shape follows handles."""
    session = live.get(source.session_uid)
    return session is not None and uses_handles(settings_of(source), session.kind)


def end(context, source, keep=False):
    """Ends live mode: the source looks as before; or the shape stays (`keep`), and its object is returned."""
    session = live.get(source.session_uid)
    if session is None:
        return None
    if keep or session.keeps_shape:
        with contextlib.suppress(UserError, ValueError, ReferenceError):
            session.settle(WAIT)
    live.part_with(source.session_uid)
    if keep:
        return session.display.keep(context, source, session.kind)
    session.take_away(source)
    return None


def end_for_job(context, source, output, result):
    """Ends live mode before a solve whose result goes there; whether there was any.

    Where the result moves the same modifier, the live shape is seen until it comes, and stays if it never
    does; otherwise the source is what it was before live mode.
    """
    session = live.get(source.session_uid)
    if session is None:
        settings_of(source).live_kind = ""  # what a file or an undone step says, with nothing behind it
        return False
    stays = session.display.in_place and settings_of(source).result == result
    end(context, source, keep=stays and placement.keeps_mesh(output, result))
    context.view_layer.update()
    return True


def stop_all():
    """Ends every worker; what is in the file stays as it is."""
    live.is_rendering = False
    live.past.clear()
    live.returning.clear()
    while live:
        live.popitem()[1].stop()


def update(context, wait=0.0, refined=False):
    """Looks at every live source once, waiting at most so many seconds for the shapes to follow."""
    return_all(context)
    live.shown_scene.follow(context, live.values())
    for uid, session in list(live.items()):
        try:
            session.update(context)
            if wait:
                session.wait(wait, refined)
            session.show()
            warn(session)
        except SourceChanged:
            restart(context, uid, session)
        except (UserError, ValueError, ReferenceError) as error:
            end_with_error(uid, session, error)


def settle(context, uid):
    """Shows the own shape of what that source's handles ask for now."""
    for _ in range(2):  # the first look may set a solver up anew
        update(context, WAIT)
        if uid in live:
            with contextlib.suppress(SourceChanged):
                return live[uid].settle(WAIT)


def warn(session):
    """Names the carried objects that are left out."""
    for reason in session.carrying.take_warnings():
        jobs.add_message("WARNING", about(session.source.name, reason))


def end_with_error(uid, session, error):
    """An undone step brings it back; a source that was deleted stays as it is."""
    source = session.source.find()
    live.part_with(uid)
    if not session.display.in_place or source is None or in_scene(source):
        take_away(session)
    jobs.add_message("ERROR", about(session.source.name, UserError("{error}; live mode ended", error=error)))


def take_away(session):
    """Takes the live shape away, also where an undone step left the source or the shape in no scene."""
    with contextlib.suppress(UserError, ReferenceError, AttributeError):
        session.take_away(session.source.find())


def watch(depsgraph):
    """Looks through what Blender has just updated for edits of live sources, and motion before the field."""
    if live:
        updates = Updates.of(depsgraph)
        for session in live.values():
            session.edits.note(updates)


def restart(context, uid, session):
    """The source or its handles changed: the solver is set up anew, the shape stays where it is."""
    source = session.source.get()
    try:
        begin(context, source, session.kind, session.keeps_shape)
    except UserError as error:
        jobs.add_message("ERROR", about(source.name, UserError("{error}; live mode ended", error=error)))


def return_all(context):
    """Has what an undone step says to be live be so again."""
    for source in [one for one in live.returning and bpy.data.objects if one.session_uid in live.returning]:
        former, kind = live.returning[source.session_uid], settings_of(source).live_kind
        try:
            begin(context, source, kind, former.keeps_shape)
        except UserError as error:
            settings_of(source).live_kind = ""
            jobs.add_message("ERROR", about(source.name, error))
    live.returning.clear()


def poll_live():
    """Called between redraws; ends when nothing is live."""
    if not live and not live.returning:
        return None
    if not live.is_rendering:
        update(bpy.context)
        if any([session.playback.take_news() for session in live.values()]):
            redraw(bpy.context, "UI")
    return INTERVAL
