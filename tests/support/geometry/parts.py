# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of closed, intersecting parts, as game characters are built."""

import numpy as np
from support.geometry.nudge import nudges

LEG = 0.1  # distance of a leg from the middle


def ellipsoid(center, radii, count):
    """A closed surface, oriented outwards."""
    u, v = np.meshgrid(
        np.linspace(0, np.pi, count + 1), 2 * np.pi * np.arange(2 * count) / (2 * count), indexing="ij"
    )
    points = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], -1).reshape(-1, 3)
    row, column = (
        each.ravel() for each in np.meshgrid(np.arange(count), np.arange(2 * count), indexing="ij")
    )
    a, b = row * 2 * count + column, row * 2 * count + (column + 1) % (2 * count)
    triangles = np.concatenate(
        [np.stack([a, a + 2 * count, b], 1), np.stack([b, a + 2 * count, b + 2 * count], 1)]
    )
    return points * radii + center, triangles


@nudges
def figure(count=24):
    """(vertices, triangles, part of each vertex): a head with a cavity, shoes that intersect."""
    hollow = ellipsoid((0, 0, 1.15), (0.33, 0.3, 0.27), count)
    parts = {
        "trunk": ellipsoid((0, 0, 0.7), (0.17, 0.12, 0.3), count),
        "head": ellipsoid((0, 0, 1.15), (0.35, 0.32, 0.29), count),
        "lining": (hollow[0], hollow[1][:, ::-1]),
    }
    for side, x in (("L", 1), ("R", -1)):
        parts[f"arm.{side}"] = ellipsoid((0.32 * x, 0, 0.8), (0.22, 0.05, 0.05), count)
        parts[f"leg.{side}"] = ellipsoid((LEG * x, 0, 0.3), (0.07, 0.07, 0.25), count)
        parts[f"shoe.{side}"] = ellipsoid((LEG * x, -0.08, 0.08), (LEG + 0.015, 0.22, 0.08), count)
    sizes = [len(vertices) for vertices, _ in parts.values()]
    starts = np.cumsum([0, *sizes[:-1]])
    triangles = [faces + start for (_, faces), start in zip(parts.values(), starts, strict=True)]
    return (
        np.concatenate([v for v, _ in parts.values()]),
        np.concatenate(triangles),
        np.repeat(list(parts), sizes),
    )
