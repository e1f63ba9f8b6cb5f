# SPDX-License-Identifier: GPL-3.0-or-later
"""Live shapes after a change of frame, in renders and in the viewport, and their contact points."""

import contextlib

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..blender.language import translated
from ..blender.object_references import settings_of, source_of
from ..core.errors import UserError
from ..core.runtime import jobs
from ..handles import empties, movers
from ..solver.contact import obstacles_of
from ..solver.source_reader import SourceChanged
from . import sessions
from .playback import scene_frame
from .sessions import WAIT, end_with_error, live

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
            jobs.add_message(*message)


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
