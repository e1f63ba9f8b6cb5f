# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles in the viewport: the rest box of each, thin, and where it is now, thick; faint behind the mesh.

Of a pin, whose Empty is a ball on the surface, the way that it has gone.
"""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..blender import user_preferences
from ..blender.object_references import settings_of, source_of
from ..handles import empties, movers

CORNERS = np.array([(x, y, z, 1.0) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
EDGES = [(a, b) for a in range(8) for b in range(a) if (CORNERS[a] != CORNERS[b]).sum() == 1]
THIN, THICK, CHOSEN = 1.5, 2.5, 4.0  # widths of lines in pixels: at rest, now, of a selected handle
HALO, HALO_ALPHA = 2.0, 0.55  # dark pixels around a line in all, which set it off from any mesh
BEHIND = 0.3  # how much of a line is left behind what hides it
NEARER = Matrix.Identity(4)  # a little towards the viewer, before the Empty's own lines
NEARER[2][3] = -2e-4


def box_lines(matrix):
    """The 24 ends of a box's edges, in world space."""
    corners = (CORNERS @ matrix.T)[:, :3]
    return [corners[end].tolist() for edge in EDGES for end in edge]


def shown_handles(source):
    """Those whose Empties are seen, and of those that bones move the one chosen in the list."""
    settings = settings_of(source)
    for index, entry in enumerate(settings.handles):
        if not movers.is_there(entry) or not movers.mover_of(entry).visible_get():
            continue
        if entry.kind != "BONE" or index == settings.active_handle:
            yield entry


def segments(source):
    """((r, g, b), width, line ends in world space) of all handles of a source."""
    lines = []
    for entry in shown_handles(source):
        rest, now = empties.rest_box(source, entry), movers.box_now(entry)
        thick = CHOSEN if entry.kind == "BONE" or entry.empty.select_get() else THICK
        way = [rest[:3, 3].tolist(), now[:3, 3].tolist()]
        if entry.kind == "PIN":
            if not np.allclose(*way, atol=1e-6):
                lines.append((tuple(entry.colour), thick, way))
            continue
        if np.allclose(rest, now, atol=1e-6):
            lines.append((tuple(entry.colour), thick, box_lines(rest)))
            continue
        lines.append((tuple(entry.colour), THIN, box_lines(rest)))
        lines.append((tuple(entry.colour), thick, box_lines(now) + way))
    return lines


def draw_lines(shader, colour, width, batch):
    """Lines with their halo, bright before what is shown and faint behind it."""
    for test, alpha in (("GREATER", BEHIND), ("LESS_EQUAL", 1.0)):
        gpu.state.depth_test_set(test)
        for shade, wide in (((0, 0, 0, HALO_ALPHA * alpha), width + HALO), ((*colour, alpha), width)):
            shader.uniform_float("color", shade)
            shader.uniform_float("lineWidth", wide)
            batch.draw(shader)


def draw():
    context = bpy.context
    source = source_of(context)
    if source is None or not context.space_data.overlay.show_overlays or not user_preferences.show_boxes():
        return
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_mask_set(False)
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    with gpu.matrix.push_pop_projection():
        gpu.matrix.load_projection_matrix(NEARER @ gpu.matrix.get_projection_matrix())
        for colour, width, ends in segments(source):
            draw_lines(shader, colour, width, batch_for_shader(shader, "LINES", {"pos": ends}))
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")
