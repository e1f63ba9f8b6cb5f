# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons of live mode, which the sections of deforming and stylizing show."""

import bpy

from ..blender.language import translated
from ..names import Op
from . import sessions


def live_buttons(layout, source, kind, refusal):
    """Live on and off, and while it is on a way to keep the shape; grey where there is a refusal."""
    on = sessions.is_live(source, kind)
    row = layout.row(align=True)
    row.scale_y = 1.4
    start = row.row(align=True)
    start.enabled = on or refusal is None
    start.operator(Op.LIVE, icon="PAUSE" if on else "PLAY", depress=on).kind = kind
    solved = sessions.solved_frames(source, bpy.context.scene) if on else None
    if solved is not None:
        count, total = solved
        text = translated("{count} of {total} frames solved", count=count, total=total)
        layout.progress(factor=count / max(1, total), text=text)
    if on:
        row.operator(Op.LIVE_KEEP, icon="CHECKMARK")
