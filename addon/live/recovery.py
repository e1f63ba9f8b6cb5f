# SPDX-License-Identifier: GPL-3.0-or-later
"""Live sessions after undo, redo, load and changes of frame, in renders and in the viewport."""

import contextlib

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..blender import host, references
from ..blender.language import translated
from ..blender.object_references import in_scene, settings_of, source_of
from ..carried import carrying
from ..core.errors import UserError
from ..core.runtime import jobs
from ..field_modifier import motion
from ..handles import empties, movers
from ..names import RESULT_SUFFIX
from ..results import placement
from ..solver.contact import obstacles_of
from ..solver.source_reader import SourceChanged
from . import live_modifier, sessions
from .playback import scene_frame
from .sessions import WAIT, end_with_error, is_live, live, poll_live, take_away

# Reconciles sessions with the live state in the file after undo, redo and load.


def after_undo():
    """Handler of undo and redo: sessions continue with the step's data; those of the step are restarted."""
    live.returning.clear()
    live.paused.clear()
    tag_written()
    recover(bring_back)
    if live.returning:
        host.start(poll_live, persistent=True)


def hold(sources):
    """Keeps the shapes at rest of sources whose coordinates have changed, the same in the world, until a
    handle moves. A style has directions in these coordinates, and is solved anew."""
    for source in sources:
        session, uid = live.get(source.session_uid), source.session_uid
        is_moving = session is not None and session.has_motion
        if settings_of(source).live_kind != "DEFORM" or is_moving or not live_modifier.is_at_rest(source):
            continue
        if session is not None:
            session.restored(is_held=True)
        elif uid in live.returning:
            live.held.add(uid)


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
        live_modifier.put_mark(source, "")
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
    original = next((one for one in live.values() if one.number == settings.live_number), None)
    if original is not None:
        forget_copy(item)
        if original.display.in_place:
            with references.between():
                motion.part_with_copies(original.source.find())
    elif item.library is None:
        adopt(item)
    else:
        live_modifier.forget(item)
    settings.live_kind = ""


def forget_copy(item):
    """Ends a duplicate's live state; the shape that it shows stays."""
    placement.keep_visibility(item)
    if item.data.users == 1:
        live_modifier.put_mark(item, "")
    live_modifier.forget_result(item)


def discard_live_object(source):
    """Ends the live state and removes the live object, if any; the modifier stays as the undo step has it."""
    item = live_modifier.forget(source)
    if item is not None:
        placement.discard(item)


def adopt(source):
    """Turns the live shape of a source without a session into a result."""
    settings, kind = settings_of(source), settings_of(source).live_kind
    item = next((entry.item for entry in settings.results if entry.kind == live_modifier.LIVE), None)
    if item is not None and not in_scene(item):
        discard_live_object(source)
        return
    placement.keep_visibility(source)
    live_modifier.put_mark(source, "")
    if item is not None:
        live_modifier.forget(source)
        item.name = item.data.name = f"{source.name}{RESULT_SUFFIX[kind]}"
        placement.register(source, kind, settings.output, item)
    elif not in_scene(source) or not is_moved(source):
        return
    text = translated("it was live when the file was saved; its shape is kept as a result")
    jobs.add_message("INFO", f"{source.name}: {text}", {source.session_uid})


def is_moved(source):
    shown = motion.snapshot(source)
    return shown is not None and shown.offsets is not None and bool(shown.offsets.any())


# Live shapes after a change of frame, in renders and in the viewport, and their contact points.

# Live shapes after a change of frame: renders wait for the solve, the viewport shows solved frames only.


def follow_frame(depsgraph):
    """Shows every live shape, solved, at the frame that is about to be rendered."""
    for uid, session in list(live.items()):
        try:
            source = session.source.get()
            if session.worker is None or source.mode != "OBJECT":
                continue
            if session.reader.moves_by_itself:
                session.reader.read_points(bpy.context, source)
            warn_of_hidden(source, session, depsgraph)
            session.set_request(session.reader.request(bpy.context, depsgraph), scene_frame(depsgraph.scene))
            session.worker.wait(WAIT, refined=True)
            session.playback.wait(session.requested, None)  # without a limit: the image must show this frame
            session.show()
        except SourceChanged:
            continue
        except (UserError, ValueError, ReferenceError) as error:
            end_with_error(uid, session, error)


def show_frame():
    """Shows the shapes of the new frame that are solved already, before the viewport is redrawn."""
    for session in list(live.values()):
        with contextlib.suppress(UserError, ValueError, ReferenceError):  # the timer reports it
            session.show_frame(bpy.context)


def warn_of_hidden(source, session, depsgraph):
    """Says once which handles and obstacles a render does not see, and so cannot follow."""
    visible = {item.original.session_uid for item in depsgraph.ids}
    used = empties.used(source)
    hidden = [movers.name_of(e) for e in used if movers.mover_of(e).session_uid not in visible]
    if not session.reader.handles:
        hidden = []
    if settings_of(source).contact.use:
        hidden += [item.name for item, _ in obstacles_of(source) if item.session_uid not in visible]
    if hidden:
        text = translated("Renders do not follow what is hidden in them: {names}", names=", ".join(hidden))
        message = "WARNING", f"{source.name}: {text}"
        if message not in jobs.messages():
            jobs.add_message(*message, {source.session_uid})


# Viewport overlay that draws a live shape's contact points.

TOUCHING_COLOUR, TOUCHING_SIZE = (1.0, 0.35, 0.1, 0.8), 7.0  # pixels


def touching_points():
    """(k, 3) contact points of the panel's source, in world space."""
    source = source_of(bpy.context)
    session = sessions.live.get(source.session_uid) if source is not None else None
    touching = None if session is None else session.touching
    if touching is None or not len(touching):
        return np.empty((0, 3))
    world = np.array(source.matrix_world)
    return touching @ world[:3, :3].T + world[:3, 3]


def draw_touching():
    context = bpy.context
    if context.region_data is None or not context.space_data.overlay.show_overlays:
        return
    found = touching_points()
    if not len(found):
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.uniform_float("color", TOUCHING_COLOUR)
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("NONE")  # obstacles would hide the points
    gpu.state.point_size_set(TOUCHING_SIZE)
    batch_for_shader(shader, "POINTS", {"pos": found.astype(np.float32).tolist()}).draw(shader)
    gpu.state.point_size_set(1.0)
    gpu.state.blend_set("NONE")
