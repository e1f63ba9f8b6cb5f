# SPDX-License-Identifier: GPL-3.0-or-later
"""Thin plates and open sheets of tests, and handles that bend and twist them."""

import numpy as np
from support.geometry import cases, meshes

FAR = 9.0  # of a box's sides that bound nothing


def open_sheet(length, width, around=40, across=40):
    """A flat rectangle about the origin, normals along z."""
    x, y = np.meshgrid(
        np.linspace(-length / 2, length / 2, around + 1),
        np.linspace(-width / 2, width / 2, across + 1),
        indexing="ij",
    )
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1), meshes.grid_triangles(around + 1, across + 1)


def plate(length, width, thickness, around=40, across=40):
    """The same with a bottom and sides: closed."""
    v, f = open_sheet(length, width, around, across)
    n = len(v)
    rows = np.arange(n).reshape(around + 1, across + 1)
    ring = np.concatenate([rows[:, 0], rows[-1, 1:], rows[-2::-1, -1], rows[0, -2:0:-1]])
    after = np.roll(ring, -1)
    sides = [np.stack([ring, ring + n, after + n], 1), np.stack([ring, after + n, after], 1)]
    lift = np.array([0, 0, thickness / 2])
    return np.concatenate([v + lift, v - lift]), np.concatenate([f, f[:, ::-1] + n, *sides])


def together(*parts):
    """One mesh of several."""
    offsets = np.cumsum([0] + [len(v) for v, _ in parts])
    triangles = [f + offset for (_, f), offset in zip(parts, offsets[:-1], strict=True)]
    return np.concatenate([v for v, _ in parts]), np.concatenate(triangles)


def arc(start, end, degrees):
    """The rigid motion of what lies beyond x = end when the strip from start to end bends up into an arc of
    its own length."""
    angle = np.radians(degrees)
    radius = (end - start) / angle
    motion = cases.turn([0, 1, 0], -degrees)
    place = np.array([start + radius * np.sin(angle), 0, radius * (1 - np.cos(angle))])
    motion[:3, 3] = place - motion[:3, :3] @ np.array([end, 0, 0])
    return motion


def ends(start, end, motion):
    """Handles that hold what lies before x = start and move what lies beyond x = end."""
    return [
        cases.moved(cases.box((-FAR, -FAR, -FAR), (start, FAR, FAR))),
        cases.moved(cases.box((end, -FAR, -FAR), (FAR, FAR, FAR)), motion),
    ]


def edge_ratios(vertices, triangles, moved):
    """Lengths of the moved edges over those at rest."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    lengths = [np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1) for v in (moved, vertices)]
    return lengths[0] / lengths[1]
