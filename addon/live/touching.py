# SPDX-License-Identifier: GPL-3.0-or-later
"""Viewport overlay that draws a live shape's contact points."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..blender.object_references import source_of
from . import sessions

COLOUR, SIZE = (1.0, 0.35, 0.1, 0.8), 7.0  # pixels


def places():
    """(k, 3) contact points of the panel's source, in world space."""
    source = source_of(bpy.context)
    session = sessions.live.get(source.session_uid) if source is not None else None
    touching = None if session is None else session.touching
    if touching is None or not len(touching):
        return np.empty((0, 3))
    world = np.array(source.matrix_world)
    return touching @ world[:3, :3].T + world[:3, 3]


def draw():
    context = bpy.context
    if context.region_data is None or not context.space_data.overlay.show_overlays:
        return
    found = places()
    if not len(found):
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.uniform_float("color", COLOUR)
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("NONE")  # obstacles would hide the points
    gpu.state.point_size_set(SIZE)
    batch_for_shader(shader, "POINTS", {"pos": found.astype(np.float32).tolist()}).draw(shader)
    gpu.state.point_size_set(1.0)
    gpu.state.blend_set("NONE")
