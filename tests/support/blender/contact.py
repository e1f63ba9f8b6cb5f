# SPDX-License-Identifier: GPL-3.0-or-later
"""A live bar pressed onto a block."""

import bpy
import numpy as np

from addon.live import sessions
from addon.solver import setup

from . import scenes
from .stacks import local_points


def pressed():
    """A live bar with one end moved down onto a block."""
    setup.SAMPLES = 3000  # as many as live solvers have by default: between fewer samples a corner could pass
    bar, _, moving = scenes.bar_with_handles()
    low = (bar.matrix_world @ bar.data.vertices[0].co).z
    for vertex in bar.data.vertices:
        low = min(low, (bar.matrix_world @ vertex.co).z)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(moving.location.x, moving.location.y, low - 0.7))
    block = bpy.context.object
    moving.location.z -= 0.8
    scenes.activate(bar)
    return bar, block, low


def lowest(bar):
    sessions.update(bpy.context, wait=600, refined=True)
    return (local_points(bar) @ np.array(bar.matrix_world)[:3, :3].T + np.array(bar.matrix_world)[:3, 3])[
        :, 2
    ].min()
