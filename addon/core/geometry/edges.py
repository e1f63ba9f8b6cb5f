# SPDX-License-Identifier: GPL-3.0-or-later
"""Edges of a triangle mesh, built on the worker, as Blender's calc_edges would block the window."""

from dataclasses import dataclass

import numpy as np


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
