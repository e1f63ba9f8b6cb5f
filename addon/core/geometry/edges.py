# SPDX-License-Identifier: GPL-3.0-or-later
"""Edges of a triangle mesh, and its coarse mesh by vertex clustering."""

from dataclasses import dataclass

import numpy as np

# Edges of a triangle mesh, built on the worker, as Blender's calc_edges would block the window.


@dataclass(frozen=True)
class Topology:
    corners: np.ndarray  # (m, 3) int32 vertex indices of the triangles
    edges: np.ndarray  # (e, 2) int32 vertex indices of the unique edges, the smaller first
    corner_edges: np.ndarray  # (m, 3) int32 index of the edge from each corner to the next
    materials: np.ndarray | None = None  # (m,) index of each triangle's material; None: the first

    def __len__(self):
        return len(self.corners)


def build_edges(corners, materials=None):
    """The topology of (m, 3) triangle corners, with (m,) materials."""
    corners = np.ascontiguousarray(corners, dtype=np.int32)
    following = corners[:, [1, 2, 0]]
    ends = np.minimum(corners, following).astype(np.int64), np.maximum(corners, following)
    keys, which = np.unique(ends[0] << 32 | ends[1], return_inverse=True)
    edges = np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1).astype(np.int32)
    return Topology(corners, edges, which.reshape(corners.shape).astype(np.int32), materials)


def most_frequent(values):
    """(m,) of each row of (m, 3) numbers: the one that it has twice, else its first."""
    return np.where(values[:, 1] == values[:, 2], values[:, 1], values[:, 0])


# Vertex clustering: merges the vertices in each grid cell to a coarse mesh that is fast to draw.

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
