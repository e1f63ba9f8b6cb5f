# SPDX-License-Identifier: GPL-3.0-or-later
"""Edges of a triangle mesh, its connected parts, and its coarse mesh by vertex clustering."""

from dataclasses import dataclass

import numpy as np

# What of a surface in a ball is connected with the ball's center through the shape, and near by.

AT_ONCE = 1 << 18  # pairs of points and triangles


def connected(points, vertices, triangles):
    """(p,) whether points of a surface belong to what the unit ball's center lies on.

    That is the part of the mesh in the ball that is joined to the triangle nearest to the center, and other
    parts of which the place there lies behind: the other side of a thin part, not the finger beside it. A
    point is on the part of the nearest triangle. All is connected where there is no triangle in the ball.
    """
    corners = vertices[triangles]
    reach = (corners.min(axis=1) <= 1).all(axis=1) & (corners.max(axis=1) >= -1).all(axis=1)
    corners, center = corners[reach], np.zeros((1, 3))
    if len(corners):
        away = np.linalg.norm(closest_points(center, corners)[0], axis=1)
        corners, away = corners[away <= 1], away[away <= 1]
    if not len(corners):
        return np.ones(len(points), dtype=bool)
    part = parts_of(corners)
    if not part.any():
        return np.ones(len(points), dtype=bool)
    first = away.argmin()
    place = closest_points(center, corners[first : first + 1])[0, 0]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    normals *= 1.0 if volume(vertices, triangles) >= 0 else -1.0
    offsets = place - closest_points(place[None], corners)[0]
    distances = np.linalg.norm(offsets, axis=1)
    heights = (offsets * normals).sum(axis=1)
    joined = np.zeros(part.max() + 1, dtype=bool)
    for k in range(len(joined)):
        own = part == k
        # of the triangles at the nearest edge or corner the one that faces the place most tells
        near = own & (distances <= distances[own].min() * (1 + 1e-9))
        joined[k] = k == part[first] or heights[near][np.abs(heights[near]).argmax()] < 0
    nearest = np.empty(len(points), dtype=np.int64)
    step = max(1, AT_ONCE // len(corners))
    for start in range(0, len(points), step):
        some = points[start : start + step]
        squares = ((closest_points(some, corners) - some[:, None]) ** 2).sum(axis=2)
        nearest[start : start + step] = squares.argmin(axis=1)
    return joined[part[nearest]]


def volume(vertices, triangles):
    """The volume that a mesh encloses, negative where its triangles face inwards."""
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    return (np.cross(a, b) * c).sum() / 6


def parts_of(corners):
    """(m,) number of the connected part of each triangle (m, 3, 3); those with a corner in one place join."""
    places = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    lowest = np.arange(places.max() + 1)
    while True:
        before, of_triangle = lowest.copy(), lowest[places].min(axis=1)
        np.minimum.at(lowest, places, of_triangle[:, None])
        lowest = lowest[lowest]
        if np.array_equal(before, lowest):
            return np.unique(of_triangle, return_inverse=True)[1]


def closest_points(points, corners):
    """(p, m, 3) point of each triangle (m, 3, 3) that is closest to each of the points (p, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    best, least = None, None
    normals = np.cross(b - a, c - a)
    square = (normals**2).sum(axis=1)
    offsets = points[:, None] - a
    heights = (offsets * normals).sum(axis=2) / np.maximum(square, 1e-300)
    foot = points[:, None] - heights[..., None] * normals
    inside = square > 0
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        from_start = points[:, None] - start
        inside = inside & ((np.cross(normals, along) * from_start).sum(axis=2) >= 0)
        shares = (from_start * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-300)
        on_edge = start + np.clip(shares, 0, 1)[..., None] * along
        squares = ((on_edge - points[:, None]) ** 2).sum(axis=2)
        if best is None:
            best, least = on_edge, squares
        else:
            nearer = squares < least
            best, least = np.where(nearer[..., None], on_edge, best), np.minimum(squares, least)
    return np.where(inside[..., None], foot, best)


# Edges of a triangle mesh, and its coarse mesh by vertex clustering.

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
