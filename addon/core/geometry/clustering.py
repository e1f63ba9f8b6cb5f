# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex clustering: merges the vertices in each grid cell to a coarse mesh that is fast to draw."""

from dataclasses import dataclass

import numpy as np

MAX_VERTICES = 12000  # of a clustered mesh


@dataclass(frozen=True)
class ClusteredMesh:
    vertices: np.ndarray  # (k, 3) some of the mesh's own
    triangles: np.ndarray  # (m, 3) int32


def cluster_vertices(vertices, triangles, most=MAX_VERTICES):
    """The mesh itself if it is small; else one vertex per grid cell, at most `most`."""
    if len(vertices) <= most:
        return ClusteredMesh(vertices, np.ascontiguousarray(triangles, dtype=np.int32))
    low, size = vertices.min(axis=0), np.ptp(vertices, axis=0).max() or 1.0
    cells = int(np.sqrt(most))
    while True:
        places = np.minimum(((vertices - low) * (cells / size)).astype(np.int64), cells - 1)
        numbers = (places[:, 0] * cells + places[:, 1]) * cells + places[:, 2]
        _, first, which = np.unique(numbers, return_index=True, return_inverse=True)
        if len(first) <= most:
            break
        cells = int(cells * 0.8)
    corners = which.reshape(-1)[triangles]
    a, b, c = corners.T
    kept = corners[(a != b) & (b != c) & (c != a)]
    return ClusteredMesh(vertices[first], np.ascontiguousarray(kept, dtype=np.int32))


def vertex_normals(vertices, triangles):
    """(n, 3) unit vertex normals, weighted by triangle area; float32."""
    corners = vertices[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = triangles.ravel()
    sums = [np.bincount(flat, np.repeat(across[:, k], 3), minlength=len(vertices)) for k in range(3)]
    normals = np.stack(sums, axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return (normals / np.where(lengths > 0, lengths, 1.0)).astype(np.float32)
