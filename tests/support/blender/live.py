# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps live sources, as their timer does."""

import bpy

from addon.live import sessions

WAIT = 300  # seconds to wait for a shape on a busy machine


def step(refined=False):
    bpy.context.view_layer.update()
    sessions.update(bpy.context, wait=WAIT, refined=refined)
