# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures of stylized meshes, z up: agreement with the style, and whether they still stand. Needs NumPy."""

import numpy as np

GROUND = 0.06  # share of the height below which vertices belong to feet
LEAST_FOOT = 4  # vertices; smaller parts are ignored


def face_normals(vertices, triangles):
    """(m, 3) unit normals and (m,) areas."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    return normals / np.maximum(lengths, 1e-300)[:, None], lengths / 2


def share_along(vertices, triangles, preferred, degrees=10.0):
    """Share of the area whose normal lies within an angle of a preferred one (k, 3)."""
    normals, areas = face_normals(vertices, triangles)
    close = (normals @ preferred.T).max(axis=1) > np.cos(np.radians(degrees))
    return float(areas[close].sum() / areas.sum())


def enclosed(vertices, triangles):
    """Volume of a closed mesh."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def tilt(rest, moved, triangles):
    """Degrees by which the closest rotation of the motion, weighted by area, tilts the z axis."""
    corners = face_normals(rest, triangles)[1] / 3
    weights = np.bincount(triangles.ravel(), np.repeat(corners, 3), len(rest))[:, None]
    arms, wanted = (p - (weights * p).sum(axis=0) / weights.sum() for p in (rest, moved))
    left, _, right = np.linalg.svd((weights * wanted).T @ arms)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return float(np.degrees(np.arccos(np.clip(turn[2, 2], -1, 1))))


def feet(rest, triangles):
    """Vertex indices of each connected part below GROUND of the rest shape's height."""
    heights = rest[:, 2]
    low = heights < heights.min() + GROUND * np.ptp(heights)
    inside = triangles[low[triangles].all(axis=1)]
    labels = np.arange(len(rest))
    while True:
        least = labels[inside].min(axis=1)
        before = labels.copy()
        for corner in inside.T:
            np.minimum.at(labels, corner, least)
        if np.array_equal(labels, before):
            break
    parts = [np.flatnonzero(labels == label) for label in np.unique(labels[inside])]
    return [part for part in parts if len(part) >= LEAST_FOOT]


def on_the_ground(rest, parts, slack=0.02):
    """The parts whose lowest point is within a share of the height of the lowest of all."""
    low, height = rest[:, 2].min(), np.ptp(rest[:, 2])
    return [part for part in parts if rest[part, 2].min() < low + slack * height]


def unevenness(vertices, parts, height):
    """Range of the heights of the feet's lowest points, as a share of the height; 0 for fewer than two."""
    if len(parts) < 2:
        return 0.0
    return float(np.ptp([vertices[part, 2].min() for part in parts]) / height)
