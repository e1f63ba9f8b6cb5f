# SPDX-License-Identifier: GPL-3.0-or-later
"""A bar slit from one end, like a closed mouth: its two jaws face each other across a gap, which may be 0."""

from collections import Counter

import numpy as np

from .cases import box, moved, turn

HINGE = -0.4  # x where the slit ends
PIVOT = (-0.5, 0.0, 0.0)


def slit_bar(gap, columns=40, rows=16, layers=6):
    """Vertices (n,3), triangles (m,3) and each vertex's jaw: −1 lower, 1 upper, 0 behind the slit.

    The bar fills [-1,1] × [-0.5,0.5] × [-0.5,0.5]. It is the boundary of a block of hexahedra; in the slit
    the lower and the upper jaw have vertices of their own, also where they lie in one place.
    """
    x = np.linspace(-1.0, 1.0, columns + 1)
    y = np.linspace(-0.5, 0.5, rows + 1)
    half = np.linspace(0.0, 0.5, layers + 1)
    numbers, places, jaws = {}, [], []

    def vertex(i, j, k, upper):
        in_slit = x[i] > HINGE + 1e-9
        key = (i, j, k, upper if k == 0 and in_slit else None)
        if key not in numbers:
            numbers[key] = len(places)
            away = max(half[abs(k)], 0.5 * gap if in_slit else 0.0)
            places.append((x[i], y[j], away if upper else -away))
            jaws.append((1 if upper else -1) if in_slit else 0)
        return numbers[key]

    faces = []
    for i in range(columns):
        for j in range(rows):
            for k in range(-layers, layers):
                upper = k >= 0
                at = np.array(
                    [vertex(i + a, j + b, k + c, upper) for a in (0, 1) for b in (0, 1) for c in (0, 1)]
                ).reshape(2, 2, 2)
                for axis in range(3):
                    for side in (0, 1):
                        (p, q), (s, t) = np.take(at, side, axis)
                        quad = [p, s, t, q] if (side == 1) == (axis != 1) else [p, q, t, s]
                        faces.append(quad)
    used = Counter(tuple(sorted(quad)) for quad in faces)
    outer = np.array([quad for quad in faces if used[tuple(sorted(quad))] == 1])
    triangles = np.concatenate([outer[:, [0, 1, 2]], outer[:, [0, 2, 3]]])
    kept, triangles = np.unique(triangles, return_inverse=True)
    return np.array(places)[kept], triangles.reshape(-1, 3), np.array(jaws)[kept]


def jaw_handles(degrees=25.0):
    """The lower jaw's front is held, the upper one's is turned about the hinge."""
    low = box((0.4, -0.6, -0.6), (1.1, 0.6, -0.05))
    high = box((0.4, -0.6, 0.05), (1.1, 0.6, 0.6))
    return [moved(low), moved(high, opening(degrees))]


def opening(degrees=25.0):
    """4×4: the turn of the upper jaw."""
    return turn((0, 1, 0), -degrees, PIVOT)


def jaw_errors(vertices, jaws, deformed, degrees=25.0):
    """Largest distances of the jaws' front halves from where their handles put them: lower, upper."""
    motion = opening(degrees)
    front = vertices[:, 0] > 0.0
    low, high = front & (jaws < 0), front & (jaws > 0)
    want = vertices @ motion[:3, :3].T + motion[:3, 3]
    return (
        np.linalg.norm(deformed[low] - vertices[low], axis=1).max(),
        np.linalg.norm(deformed[high] - want[high], axis=1).max(),
    )
