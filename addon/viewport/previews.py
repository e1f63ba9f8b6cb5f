# SPDX-License-Identifier: GPL-3.0-or-later
"""What a running solve has so far, drawn over the viewport: nothing of it is ever in the file."""

import numpy as np

from ..core.geometry.clustering import coarsened, vertex_normals
from .drawing import ViewportDrawing

COLOUR = np.array([0.98, 0.60, 0.22], dtype=np.float32)
LIGHT = np.array([0.3, -0.5, 0.81], dtype=np.float32)
AMBIENT = 0.35
_shown = None  # (points in world space, normals, triangles)
_batch = None


class Preview:
    """A coarse mesh of the source in solve space; where it goes is what is drawn."""

    def __init__(self, surface):
        self._surface, self._coarse = surface, None

    @property
    def points(self):
        """(k, 3) points to watch; the worker asks, so that a large mesh does not hold the window."""
        if self._coarse is None:
            self._coarse = coarsened(self._surface.vertices, self._surface.triangles)
        return self._coarse.vertices

    def show(self, points):
        global _shown, _batch
        world = self._surface.space.solve_to_world
        placed = (points.astype(np.float64) @ world[:3, :3].T + world[:3, 3]).astype(np.float32)
        _shown = placed, vertex_normals(placed, self._coarse.triangles), self._coarse.triangles
        _batch = None


def is_shown():
    return _shown is not None


def clear():
    global _shown, _batch
    _shown = _batch = None


def made_batch():
    """The vertices with their shades, for the graphics card."""
    import gpu

    points, normals, triangles = _shown
    shade = AMBIENT + (1 - AMBIENT) * np.abs(normals @ LIGHT)
    colours = np.concatenate([COLOUR * shade[:, None], np.ones((len(shade), 1), np.float32)], axis=1)
    layout = gpu.types.GPUVertFormat()
    layout.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
    layout.attr_add(id="color", comp_type="F32", len=4, fetch_mode="FLOAT")
    vertices = gpu.types.GPUVertBuf(format=layout, len=len(points))
    vertices.attr_fill("pos", np.ascontiguousarray(points))
    vertices.attr_fill("color", np.ascontiguousarray(colours, dtype=np.float32))
    indices = gpu.types.GPUIndexBuf(type="TRIS", seq=triangles)
    return gpu.types.GPUBatch(type="TRIS", buf=vertices, elem=indices)


def draw():
    global _batch
    import gpu

    if _shown is None:
        return
    if _batch is None:
        _batch = made_batch()
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    _batch.draw(gpu.shader.from_builtin("SMOOTH_COLOR"))
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")


_drawing = ViewportDrawing(draw)
register = _drawing.register


def unregister():
    clear()
    _drawing.unregister()
