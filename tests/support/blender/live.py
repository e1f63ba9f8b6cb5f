# SPDX-License-Identifier: GPL-3.0-or-later
"""Stepping live sources, as their timer does."""

import bpy

from addon.live import sessions

WAIT = 300  # seconds for a shape to follow on a busy machine


def step(refined=False):
    bpy.context.view_layer.update()
    sessions.update(bpy.context, wait=WAIT, refined=refined)
