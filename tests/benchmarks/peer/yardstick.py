# SPDX-License-Identifier: GPL-3.0-or-later
"""What is measured of a deformed mesh, whoever deformed it: all at the same vertices."""

import numpy as np

from ..shapes import volume


def normals(vertices, triangles):
    """(m,3) of the triangles, as long as twice their areas."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def cotangents(vertices, triangles):
    """Edges i, j and their weights, each edge of each triangle both ways; none below 0."""
    ends, weights = [], []
    for k in range(3):
        a, b, c = (np.roll(triangles, -m, 1)[:, k] for m in range(3))
        u, v = vertices[a] - vertices[c], vertices[b] - vertices[c]
        cot = (u * v).sum(1) / np.maximum(np.linalg.norm(np.cross(u, v), axis=1), 1e-12) / 2
        cot = np.maximum(cot, 0)  # marching cubes leave slivers
        ends += [(a, b), (b, a)]
        weights += [cot, cot]
    i, j = (np.concatenate(side) for side in zip(*ends, strict=True))
    return i, j, np.concatenate(weights)


def rotations(vertices, triangles, moved):
    """(n,3,3): of each vertex the rotation that fits its edges best; and the ARAP energy of the mesh, the sum
    over vertices of their edges' squared misfits to it, weighted by cotangents."""
    i, j, w = cotangents(vertices, triangles)
    before, after = vertices[j] - vertices[i], moved[j] - moved[i]
    spread = np.zeros((len(vertices), 3, 3))
    np.add.at(spread, i, w[:, None, None] * after[:, :, None] * before[:, None, :])
    left, _, right = np.linalg.svd(spread)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    found = left @ right
    misfit = after - np.einsum("nij,nj->ni", found[i], before)
    return found, float((w * (misfit**2).sum(1)).sum())


def folded(vertices, triangles, moved, turned):
    """Share of the rest area of triangles that face away from where their corners' rotations turn them."""
    before = normals(vertices, triangles)
    expected = np.einsum("nij,nj->ni", turned[triangles].mean(1), before)
    against = (expected * normals(moved, triangles)).sum(1) < 0
    areas = np.linalg.norm(before, axis=1)
    return float(areas[against].sum() / areas.sum())


def measured(problem, moved):
    """The fields of a row."""
    turned, energy = rotations(problem.vertices, problem.triangles, moved)
    size = np.linalg.norm(np.ptp(problem.vertices, axis=0))
    apart = np.linalg.norm(moved[problem.moved] - problem.goals, axis=1)
    still = np.linalg.norm(moved[problem.held] - problem.vertices[problem.held], axis=1)
    whole = volume(problem.vertices, problem.triangles)
    return {
        "mesh_energy": round(energy, 4),
        "handle_error_percent": round(100 * max(apart.mean(), still.mean()) / size, 3),
        "volume_ratio": round(volume(moved, problem.triangles) / whole, 3),
        "folded_percent": round(100 * folded(problem.vertices, problem.triangles, moved, turned), 3),
    }


def styled(vertices, triangles, moved, preferred):
    """The same of a stylized mesh, and how near to the preferred normals (k,3) its area is."""
    turned, energy = rotations(vertices, triangles, moved)
    long = normals(moved, triangles)
    areas = np.linalg.norm(long, axis=1)
    cosines = (long / np.maximum(areas, 1e-30)[:, None] @ preferred.T).max(1)
    return {
        "mesh_energy": round(energy, 4),
        "mean_angle": round(
            float(np.average(np.degrees(np.arccos(np.clip(cosines, -1, 1))), weights=areas)), 2
        ),
        "within_10_percent": round(
            100 * float(areas[cosines > np.cos(np.radians(10))].sum() / areas.sum()), 1
        ),
        "volume_ratio": round(volume(moved, triangles) / volume(vertices, triangles), 3),
        "folded_percent": round(100 * folded(vertices, triangles, moved, turned), 3),
    }
