# SPDX-License-Identifier: GPL-3.0-or-later
"""Previews of running solves, drawn as an overlay, never stored in the file."""

import numpy as np

from ..core.geometry.edges import cluster_vertices, vertex_normals

COLOUR = np.array([0.98, 0.60, 0.22], dtype=np.float32)
LIGHT = np.array([0.3, -0.5, 0.81], dtype=np.float32)
AMBIENT = 0.35


class Shown:
    """The mesh to draw: `mesh` is (points in world space, normals, triangles), or None."""

    def __init__(self):
        self.mesh = self.batch = None

    def set(self, mesh):
        self.mesh, self.batch = mesh, None

    def clear(self):
        self.set(None)


shown = Shown()


class Preview:
    """A coarse mesh of the source in solve space, drawn at its moved points."""

    def __init__(self, surface):
        self._surface, self._clustered = surface, None

    @property
    def points(self):
        """(k, 3) points at rest; called on the worker, as clustering a large mesh is slow."""
        if self._clustered is None:
            self._clustered = cluster_vertices(self._surface.vertices, self._surface.triangles)
        return self._clustered.vertices

    def show(self, points):
        world = self._surface.space.solve_to_world
        placed = (points.astype(np.float64) @ world[:3, :3].T + world[:3, 3]).astype(np.float32)
        triangles = self._clustered.triangles
        shown.set((placed, vertex_normals(placed, triangles), triangles))

    def clear(self):
        shown.clear()

    hand_over = keep = clear


def batch_of(points, normals, triangles):
    """GPU batch of the vertices with shaded colours."""
    import gpu

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
    import gpu

    if shown.mesh is None:
        return
    if shown.batch is None:
        shown.batch = batch_of(*shown.mesh)
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    shown.batch.draw(gpu.shader.from_builtin("SMOOTH_COLOR"))
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")
