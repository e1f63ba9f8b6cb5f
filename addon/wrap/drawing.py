# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws each pair of landmarks in the viewport: its number on a disc of its colour, at both ends."""

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..blender.object_references import settings_of, source_of
from ..pin_tool import screen
from ..pin_tool.drawing import CIRCLE, DARK
from . import landmarks

RADIUS, SIZE = 9, 11  # of a disc, and of its number, in pixels


def draw():
    context = bpy.context
    source = source_of(context) if context.region_data is not None else None
    if source is None or not context.space_data.overlay.show_overlays:
        return
    used, size = landmarks.used(source), (context.region.width, context.region.height)
    perspective = np.array(context.region_data.perspective_matrix)
    gpu.state.blend_set("ALPHA")
    for number, entry in enumerate(settings_of(source).wrap.landmarks, 1):
        for item in (entry.rest, entry.on_target) if entry in used else ():
            place = item.matrix_world.translation
            if item == entry.rest:
                place = landmarks.shown_place(source, place)
            spot = screen.project(perspective, size, place)[0]
            if item.visible_get() and np.isfinite(spot).all():
                disc(context, spot, tuple(entry.colour), str(number))
    gpu.state.blend_set("NONE")


def disc(context, spot, colour, text):
    """Draws a number on a disc around a pixel, dark or bright by the colour's luminance."""
    scale, shader = context.preferences.system.ui_scale, gpu.shader.from_builtin("UNIFORM_COLOR")
    for shade, radius in ((DARK, RADIUS + 1.5), ((*colour, 1.0), RADIUS)):
        rim = spot + radius * scale * CIRCLE
        shader.uniform_float("color", shade)
        fan = [(*rim[i], 0.0) for k in range(1, len(rim) - 1) for i in (0, k, k + 1)]
        batch_for_shader(shader, "TRIS", {"pos": fan}).draw(shader)
    dark = np.dot(colour, (0.3, 0.59, 0.11)) > 0.45
    blf.size(0, SIZE * scale)
    width, height = blf.dimensions(0, text)
    blf.position(0, spot[0] - width / 2, spot[1] - height / 2, 0)
    blf.color(0, *((0, 0, 0, 1) if dark else (1, 1, 1, 1)))
    blf.draw(0, text)
