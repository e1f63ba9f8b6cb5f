# SPDX-License-Identifier: GPL-3.0-or-later
"""The one table of what Blender calls beside operators and panels, and of the extension's state."""

import contextlib

import bpy
from bpy.app.handlers import persistent

from . import commands, first_run, menus
from .blender import former_defaults, host, icons, language, modifier_stack
from .blender.host import has_window
from .blender.language import translated
from .carried import carrying
from .core.runtime import jobs, threads
from .deform import solve_job
from .field_modifier import layers, motion
from .handles import applied_transforms, empties, held_counts, left_behind, overlays, symmetry
from .jobs import job_operator
from .jobs.display import display
from .live import live_modifier, recovery, sessions
from .live.live_solver import prefetch
from .pin_tool import drawing, tool
from .pin_tool.drawing import status
from .pin_tool.hover import hover
from .poses import applying
from .solver import style_settings
from .surface import source_surface
from .wrap import landmark_tools, landmarks


@persistent
def before_load(*_):
    """The file is about to go: whatever works on it ends, and nothing of it is applied."""
    passing = (jobs.board, held_counts.pending, source_surface.changed, empties.seen_active, prefetch)
    for state in (*passing, applying.solved, solve_job.steps, left_behind.seen, live_modifier.shapes):
        state.clear()
    applied_transforms.seen.clear()
    applied_transforms.followed.clear()
    carrying.written.clear()
    sessions.stop_all()
    jobs.forget_messages()


@persistent
def before_undo(*_):
    """What a job is at work on, and what the messages tell of, belong to the step that is left."""
    job = jobs.running()
    jobs.stop()
    display.clear_previews()
    jobs.forget_messages()
    if job is not None:
        jobs.add_message("INFO", translated("{job} cancelled", job=translated(job.title)))


@persistent
def before_save(*_):
    former_defaults.stamp()
    display.clear_previews()


@persistent
def after_load(*_):
    former_defaults.keep()
    hover.clear()
    solve_job.steps.recover()
    recovery.after_load()


@persistent
def after_restore(*_):
    """A step was undone or redone."""
    hover.clear()
    solve_job.steps.recover()
    changed = applied_transforms.after_undo()
    recovery.after_undo()
    recovery.hold(changed)


@persistent
def after_update(scene, depsgraph):
    if not modifier_stack.is_stage(scene):
        source_surface.watch(depsgraph)
        if not sessions.live.is_rendering:
            recovery.hold(applied_transforms.follow(depsgraph))
        sessions.watch(depsgraph)
        motion.written.clear()
        if not sessions.live.is_rendering:
            empties.follow_active(bpy.context)
            left_behind.follow(bpy.context)
            active = getattr(bpy.context, "active_object", None)
            if active is not None:
                recovery.disown(active)
                if active.library is None:
                    layers.switch_copies_off(active)


@persistent
def before_render(*_):
    sessions.live.is_rendering = True


@persistent
def after_render(*_):
    sessions.live.is_rendering = False


@persistent
def after_frame(scene, depsgraph):
    if sessions.live.is_rendering:
        recovery.follow_frame(depsgraph)
    elif sessions.live and not modifier_stack.is_stage(scene):
        recovery.show_frame()


HANDLERS = {  # of bpy.app.handlers
    "load_pre": before_load,
    "load_post": after_load,
    "save_pre": before_save,
    "undo_pre": before_undo,
    "undo_post": after_restore,
    "redo_pre": before_undo,
    "redo_post": after_restore,
    "depsgraph_update_post": after_update,
    "render_init": before_render,
    "render_complete": after_render,
    "render_cancel": after_render,
    "frame_change_post": after_frame,
}
DRAWINGS = (  # over every 3D viewport
    *((overlays.draw_previews, "POST_VIEW"), (overlays.draw_handle_boxes, "POST_VIEW")),
    *((drawing.draw, "POST_VIEW"), (recovery.draw_touching, "POST_VIEW")),
    *((landmark_tools.draw, "POST_PIXEL"), (drawing.draw_label, "POST_PIXEL")),
    (first_run.draw, "POST_PIXEL"),
)
PARTS = (  # what begins with the extension, and how it ends
    (icons.load, icons.clear),
    (language.load, language.clear),
    (commands.register, commands.unregister),
    (menus.begin, menus.end),
    (first_run.start, None),
    (host.start_loading, None),
    (first_run.check_installation, None),
    (tool.register, tool.unregister),
)
# What may be there when the extension is disabled, in the order in which it ends; each has clear().
# Timers are started by blender/host.py, threads by core/runtime/threads.py.
STATE = (job_operator.runs, jobs.board, display, sessions.live, held_counts.pending, source_surface.changed)
STATE += (motion.written, carrying.written, hover, prefetch, applying.solved, overlays.shown)
STATE += (solve_job.steps, empties.seen_active, host, style_settings.style_cache, left_behind.seen)
STATE += (live_modifier.shapes, applied_transforms.seen, applied_transforms.followed, status, symmetry.planes)
STATE += (first_run.welcome, landmarks.nearest, landmark_tools.half)

LONGEST = 10.0  # seconds that the end of the process waits for a thread

_begun, _drawn = [], []


def end_threads():
    """Where the process ends with the extension still enabled: no thread may be at work in the native library
    when that is unloaded. Nothing of Blender's is there any more."""
    jobs.stop()
    for session in sessions.live.values():
        if session.worker is not None:
            session.worker.stop()
    for thread in threads.own_threads():
        thread.join(LONGEST)


def register():
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(function)
    if has_window():
        for draw, when in DRAWINGS:
            _drawn.append(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when))
    for begin, end in PARTS:
        begin()
        _begun.append(end)


def unregister():
    for state in STATE:
        state.clear()
    jobs.forget_messages()
    while _begun:
        end = _begun.pop()
        if end is not None:
            end()
    while _drawn:
        bpy.types.SpaceView3D.draw_handler_remove(_drawn.pop(), "WINDOW")
    for name, function in HANDLERS.items():
        with contextlib.suppress(ValueError):
            getattr(bpy.app.handlers, name).remove(function)
