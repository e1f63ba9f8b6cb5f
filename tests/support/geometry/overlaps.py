# SPDX-License-Identifier: GPL-3.0-or-later
"""Two measures of self-intersection that is not present at rest."""

import numpy as np
from scipy.spatial import cKDTree

import arapfields as af


def areas(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def overlapping(rest, vertices, triangles):
    """Share of the area that lies inside another part, by winding numbers."""
    import trimesh

    def inside(points):
        normals = trimesh.Trimesh(points, triangles, process=False).vertex_normals
        size = np.ptp(rest, axis=0).max()
        return np.asarray(af.winding_number(points, triangles, points - 5e-4 * size * normals)) > 1.5

    twice = inside(vertices) & ~inside(rest)
    weights = areas(rest, triangles)
    return float(weights @ twice[triangles].mean(1) / weights.sum())


def crossing(rest, vertices, triangles):
    """Share of the area of triangles cut by edges of others that are not their neighbors at rest."""
    corners, before = vertices[triangles], rest[triangles].mean(1)
    middles = corners.mean(1)
    radius = np.linalg.norm(corners - middles[:, None], axis=2).max()
    tree = cKDTree(middles)
    pairs = tree.query_pairs(2 * radius, output_type="ndarray")
    far = np.linalg.norm(before[pairs[:, 0]] - before[pairs[:, 1]], axis=1) > 4 * radius
    pairs = pairs[far]
    cut = np.zeros(len(triangles), bool)
    for i, j in ((0, 1), (1, 0)):
        a, b, c = (corners[pairs[:, i], k] for k in range(3))
        normal = np.cross(b - a, c - a)
        for k in range(3):
            p, q = corners[pairs[:, j], k], corners[pairs[:, j], (k + 1) % 3]
            s, t = ((p - a) * normal).sum(1), ((q - a) * normal).sum(1)
            through = s * t < 0
            x = p + (s / np.where(through, s - t, 1))[:, None] * (q - p)
            for u, v in ((a, b), (b, c), (c, a)):
                through &= (np.cross(v - u, x - u) * normal).sum(1) > 0
            cut[pairs[through].ravel()] = True
    weights = areas(rest, triangles)
    return float(weights[cut].sum() / weights.sum())
