# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles in the viewport: the rest box of each, faint, and where it is now, bright."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..blender import user_preferences
from ..blender.object_references import in_scene, settings_of, source_of
from ..handles import empties

CORNERS = np.array([(x, y, z, 1.0) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
EDGES = [(a, b) for a in range(8) for b in range(a) if (CORNERS[a] != CORNERS[b]).sum() == 1]
REST_ALPHA, NOW_ALPHA = 0.35, 0.95


def box_lines(matrix):
    """The 24 ends of a box's edges, in world space."""
    corners = (CORNERS @ matrix.T)[:, :3]
    return [corners[end].tolist() for edge in EDGES for end in edge]


def segments(source):
    """((r, g, b, alpha), line ends in world space) of all handles of a source."""
    lines = []
    for entry in settings_of(source).handles:
        if not in_scene(entry.empty) or not entry.empty.visible_get():
            continue
        rest, now = empties.rest_box(source, entry), empties.current_box(entry.empty)
        lines.append(((*entry.colour, REST_ALPHA), box_lines(rest)))
        if not np.allclose(rest, now, atol=1e-6):
            lines.append(((*entry.colour, NOW_ALPHA), box_lines(now)))
            lines.append(((*entry.colour, NOW_ALPHA), [rest[:3, 3].tolist(), now[:3, 3].tolist()]))
    return lines


def draw():
    context = bpy.context
    source = source_of(context)
    if source is None or not context.space_data.overlay.show_overlays or not user_preferences.show_boxes():
        return
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("NONE")
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", 2.0)
    for shade, ends in segments(source):
        shader.uniform_float("color", shade)
        batch_for_shader(shader, "LINES", {"pos": ends}).draw(shader)
    gpu.state.blend_set("NONE")
