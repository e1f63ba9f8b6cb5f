# SPDX-License-Identifier: GPL-3.0-or-later
"""Reconciles sessions with the live state in the file after undo, redo and load."""

import contextlib

import bpy

from ..blender import host
from ..blender.language import translated
from ..blender.object_references import in_scene, settings_of
from ..carried import carrying
from ..core.errors import UserError
from ..core.runtime import jobs
from ..field_modifier import motion
from ..names import RESULT_SUFFIX
from ..results import placement, result_objects
from . import live_modifier, stored
from .sessions import is_live, live, poll_live, take_away


def after_undo():
    """Handler of undo and redo: sessions continue with the step's data; those of the step are restarted."""
    live.returning.clear()
    live.paused.clear()
    tag_written()
    recover(bring_back)
    if live.returning:
        host.start(poll_live, persistent=True)


def after_load():
    """Load handler: objects that were live when the file was saved become results."""
    recover(adopt)


def tag_written():
    """Has Blender evaluate what live mode has moved: undo does so for changes up to the last step alone."""
    uids = carrying.written | {former.uid for former in live.past.values()} | set(live)
    for item in list(bpy.data.objects) if uids else ():
        if item.session_uid in uids and item.library is None:
            item.update_tag()
            if item.data is not None:
                item.data.update_tag()


def recover(clear):
    """Ends sessions whose source is not live any more, and calls `clear(source)` for sources that are marked
    as live without a session."""
    for uid, session in list(live.items()):
        source = session.source.find()
        settings = None if source is None else settings_of(source)
        if settings is None or not settings.live_kind or settings.live_number != session.number:
            live.part_with(uid)
            if settings is not None and not settings.live_kind and session.display.in_place:
                session.display.leave(source)
            if not session.display.in_place and (settings is None or not settings.live_kind):
                take_away(session)
        else:
            session.restored()  # its motion may have been undone
    # A list: clear() deletes objects, which invalidates Blender's iterator.
    for source in [s for s in bpy.data.objects if settings_of(s).live_kind and not is_live(s)]:
        with contextlib.suppress(UserError, RuntimeError, AttributeError):
            if not clear(source):
                settings_of(source).live_kind = ""


def bring_back(source):
    """Marks the source's ended session for a restart and returns True; without one, ends the live state."""
    number = settings_of(source).live_number
    former = live.past.get(number)
    if former is not None and former.uid != source.session_uid:
        return forget_copy(source)
    if former is None or not former.display.is_there():
        stored.put_mark(source, "")
        return discard_live_object(source)
    live.past.keep(number, former)
    live.returning[source.session_uid] = former
    return True


def disown(item):
    """Ends the live state of an object without a session: a duplicate of a live object, or one linked or
    appended from another file."""
    settings = settings_of(item)
    if (
        not settings.live_kind
        or is_live(item)
        or item.session_uid in (live.begun, *live.returning, *live.paused)
    ):
        return
    if any(session.number == settings.live_number for session in live.values()):
        forget_copy(item)
    elif item.library is None:
        adopt(item)
    else:
        live_modifier.forget(item)
    settings.live_kind = ""


def forget_copy(item):
    """Ends a duplicate's live state; the shape that it shows stays."""
    placement.keep_visibility(item)
    if item.data.users == 1:
        stored.put_mark(item, "")
    live_modifier.forget_result(item)


def discard_live_object(source):
    """Ends the live state and removes the live object, if any; the modifier stays as the undo step has it."""
    item = live_modifier.forget(source)
    if item is not None:
        result_objects.discard(item)


def adopt(source):
    """Turns the live shape of a source without a session into a result."""
    settings, kind = settings_of(source), settings_of(source).live_kind
    item = next((entry.item for entry in settings.results if entry.kind == live_modifier.LIVE), None)
    if item is not None and not in_scene(item):
        discard_live_object(source)
        return
    placement.keep_visibility(source)
    stored.put_mark(source, "")
    if item is not None:
        live_modifier.forget(source)
        item.name = item.data.name = f"{source.name}{RESULT_SUFFIX[kind]}"
        result_objects.register(source, kind, settings.output, item)
    elif not in_scene(source) or not is_moved(source):
        return
    text = translated("it was live when the file was saved; its shape is kept as a result")
    jobs.add_message("INFO", f"{source.name}: {text}")


def is_moved(source):
    shown = motion.snapshot(source)
    return shown is not None and shown.offsets is not None and bool(shown.offsets.any())
