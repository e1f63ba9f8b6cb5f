# SPDX-License-Identifier: GPL-3.0-or-later
"""Live shapes after a change of frame: renders wait for the solve, the viewport shows solved frames only."""

import contextlib

import bpy

from ..blender.language import translated
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..core.runtime import jobs
from ..handles import empties, movers
from ..solver.contact import obstacles_of
from ..solver.source_reader import SourceChanged
from .playback import scene_frame
from .sessions import WAIT, end_with_error, live


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
            jobs.add_message(*message)
