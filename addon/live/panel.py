# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of live mode and of its results, for other sections, and the panel of secondary motion."""

import bpy

from ..blender import modifier_stack, vertex_groups
from ..blender.language import translated
from ..blender.object_references import settings_of, source_of
from ..blender.section import (
    Section,
    cancel_button,
    draw_settings,
    group_row,
    note,
    settings_column,
    switched,
)
from ..field_modifier import layers, node_group
from ..names import Op
from ..solver import secondary_motion
from ..solver.frame_range import scene_range
from . import sessions
from .properties import SECONDARY


def pose_button(layout, source, refusal):
    """Draws the button that poses, or the one that ends that, and the one that takes the pose away."""
    row = layout.row(align=True)
    row.scale_y = 1.4
    if cancel_button(row, Op.DEFORM):
        return
    on = sessions.is_live(source, "DEFORM")
    start = row.row(align=True)
    start.enabled = on or refusal is None
    if on:
        start.operator(Op.DEFORM, text="Finish Pose", icon="CHECKMARK", depress=True)
    else:
        start.operator(Op.LIVE, text="Pose", icon="PLAY").kind = "DEFORM"
    start.operator_menu_enum(Op.DEFORM, "scope", text="", icon="DOWNARROW_HLT")
    remove_button(row, source, "DEFORM")


def live_buttons(layout, source, refusal):
    """Draws the toggle of a live style, greyed out if there is a refusal, and while live Keep Shape."""
    on = sessions.is_live(source, "STYLIZE")
    row = layout.row(align=True)
    row.scale_y = 1.4
    start = row.row(align=True)
    start.enabled = on or refusal is None
    icon = "PAUSE" if on else "PLAY"
    start.operator(Op.LIVE, text="Live Stylize", icon=icon, depress=on).kind = "STYLIZE"
    if on:
        row.operator(Op.LIVE_KEEP, icon="CHECKMARK")


def result_row(layout, source, kind):
    """Draws how far the result of that kind goes, and the button that removes it; nothing without one."""
    modifier = layers.carrying(source, kind)
    if modifier is None:
        return
    row = layout.row(align=True)
    socket = node_group.slot(modifier, "Factor")
    if socket is not None:
        row.prop(socket, "value", text="Factor", slider=True)
    else:
        row.prop(modifier, f'["{node_group.identifier(modifier, "Factor")}"]', text="Factor", slider=True)
    if kind != "DEFORM":  # beside its button
        remove_button(row, source, kind)


def remove_button(row, source, kind):
    """Draws the button that removes the result of that kind, greyed out below another one."""
    modifier, on = layers.carrying(source, kind), sessions.is_live(source, kind)
    button = row.row(align=True)
    button.enabled = on or (modifier is not None and modifier == modifier_stack.top(source))
    button.operator(Op.REMOVE_RESULT, text="", icon="X").kind = kind


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


class ARAPFIELDS_PT_secondary(Section, bpy.types.Panel):
    bl_label = "Secondary Motion"
    bl_order = 10
    tasks = frozenset({"ANIMATE"})
    bl_options = {"DEFAULT_CLOSED"}

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
