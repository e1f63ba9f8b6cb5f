# SPDX-License-Identifier: GPL-3.0-or-later
"""What a file, or a step that was undone, says of live mode where no session stands behind it."""

import contextlib

import bpy

from ..blender import timers
from ..blender.language import translated
from ..blender.object_references import in_scene, settings_of
from ..core.errors import UserError
from ..core.runtime import jobs
from ..field_modifier import motion
from ..names import RESULT_SUFFIX
from ..results import result_objects, visibility
from . import live_object, stored
from .sessions import is_live, live, poll_live, take_away


def after_undo():
    """A step was undone or redone: sessions go on with what it has, and those of the step come back."""
    live.returning.clear()
    recover(bring_back)
    if live.returning:
        timers.start(poll_live, persistent=True)


def after_load():
    """A file was loaded: what was live when it was saved is a result now."""
    recover(adopt)


def recover(clear):
    """Ends what no session or no source knows as live any more; `clear(source)` deals with one that is said
    to be live, and is not."""
    for uid, session in list(live.items()):
        source = session.source.find()
        settings = None if source is None else settings_of(source)
        if settings is None or not settings.live_kind or settings.live_number != session.number:
            live.part_with(uid)
            if settings is not None and not settings.live_kind and session.display.in_place:
                session.display.leave(source)
            if not session.display.in_place:
                take_away(session)
        else:
            session.restored()  # what it wrote may have been undone
    # A list: clear() deletes objects, and Blender's own iterator would go on from one that is gone.
    for source in [s for s in bpy.data.objects if settings_of(s).live_kind and not is_live(s)]:
        with contextlib.suppress(UserError, RuntimeError, AttributeError):
            if not clear(source):
                settings_of(source).live_kind = ""


def bring_back(source):
    """Whether the session by which the source was live comes back; a live object without one goes."""
    number = settings_of(source).live_number
    former = live.past.get(number)
    if former is not None and former.uid != source.session_uid:
        return forget_copy(source)
    if former is None or not former.display.in_place:
        stored.put_mark(source, "")
        return discard_live_object(source)
    live.past.keep(number, former)
    live.returning[source.session_uid] = former
    return True


def disown(item):
    """An object that says it is live without a session of its own: a copy of one that is, or one from another
    file."""
    settings = settings_of(item)
    if not settings.live_kind or is_live(item) or item.session_uid in (live.begun, *live.returning):
        return
    if any(session.number == settings.live_number for session in live.values()):
        forget_copy(item)
    elif item.library is None:
        adopt(item)
    else:
        live_object.forget(item)
    settings.live_kind = ""


def forget_copy(item):
    """What a copy of a live object shows is its own."""
    visibility.forget(item)
    if item.data.users == 1:
        stored.put_mark(item, "")
    live_object.forget_result(item)


def discard_live_object(source):
    """The modifier has what that step says."""
    item = live_object.forget(source)
    if item is not None:
        result_objects.discard(item)


def adopt(source):
    """Keeps the shape that was seen as a result."""
    settings, kind = settings_of(source), settings_of(source).live_kind
    item = next((entry.item for entry in settings.results if entry.kind == live_object.LIVE), None)
    if item is not None and not in_scene(item):
        discard_live_object(source)
        return
    visibility.forget(source)
    stored.put_mark(source, "")
    if item is not None:
        live_object.forget(source)
        item.name = item.data.name = f"{source.name}{RESULT_SUFFIX[kind]}"
        result_objects.register(source, kind, settings.output, item)
    elif not is_moved(source):
        return
    text = translated("it was live when the file was saved; its shape is kept as a result")
    jobs.add_message("INFO", f"{source.name}: {text}")


def is_moved(source):
    shown = motion.snapshot(source)
    return shown is not None and shown.offsets is not None and bool(shown.offsets.any())
