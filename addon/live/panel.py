# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of live mode, for the sections Deform and Stylize, and the panel of secondary motion."""

import bpy

from ..blender import vertex_groups
from ..blender.language import translated
from ..blender.object_references import settings_of, source_of
from ..blender.section import Advanced, draw_settings, group_row, note, settings_column, switched
from ..names import Op
from ..solver import secondary_motion
from ..solver.frame_range import scene_range
from . import sessions
from .properties import SECONDARY


def live_buttons(layout, source, kind, refusal):
    """Draws the toggle of live mode, greyed out if there is a refusal, and while live Keep Shape."""
    on = sessions.is_live(source, kind)
    row = layout.row(align=True)
    row.scale_y = 1.4
    start = row.row(align=True)
    start.enabled = on or refusal is None
    names = {"DEFORM": translated("Live Deform"), "STYLIZE": translated("Live Stylize")}
    start.operator(Op.LIVE, text=names[kind], icon="PAUSE" if on else "PLAY", depress=on).kind = kind
    if on:
        row.operator(Op.LIVE_KEEP, icon="CHECKMARK")


def solved_frames(source, scene):
    """(solved frames, all frames) of the scene's range; None if no frame was requested."""
    session = sessions.live.get(source.session_uid)
    frames = None if session is None else session.playback.frames
    if frames is None:
        return None
    first, last = scene_range(scene)
    return frames.count(first, last), last - first + 1


def playback_progress(layout, source, kind):
    """Draws a progress bar of the scene's solved frames."""
    on = sessions.is_live(source, kind)
    solved = solved_frames(source, bpy.context.scene) if on else None
    if solved is not None:
        count, total = solved
        text = translated("{count} of {total} frames solved", count=count, total=total)
        layout.progress(factor=count / max(1, total), text=text)


class ARAPFIELDS_PT_secondary(Advanced, bpy.types.Panel):
    bl_label = "Secondary Motion"
    bl_order = 6
    tasks = frozenset({"POSE"})

    def draw_header(self, context):
        self.layout.prop(settings_of(source_of(context)).secondary, "use", text="")

    def fill(self, context, source, settings):
        group = settings.secondary
        layout = self.layout.column()
        layout.enabled = group.use
        settings_column(layout, group, SECONDARY, advanced=False)
        group_row(layout, group, "group", source)
        draw_settings(layout, group, "start")
        switched(layout, group, "use_ground", "ground")
        note(layout, vertex_groups.missing(source, secondary_motion.group_names(source)))


CLASSES = [ARAPFIELDS_PT_secondary]
