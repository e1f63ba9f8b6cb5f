# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of tests: capsules with clothes, and closed parts that intersect."""

import numpy as np
from support.geometry.nudge import nudges

import arapfields as af

# Simple bodies of capsules, and clothes, for tests of attached geometry.


class Capsules(af.ImplicitFunction):
    """Signed distance of capsules (start, end, radius), smoothly blended."""

    BLEND = 40.0

    def __init__(self, parts, frame):
        super().__init__(frame)
        self.parts = [(np.array(a, float), np.array(b, float), float(r)) for a, b, r in parts]

    def distances(self, points):
        """(parts, n) distances to each capsule."""
        solids = []
        for start, end, radius in self.parts:
            way = end - start
            share = np.clip((points - start) @ way / (way @ way), 0, 1)
            solids.append(np.linalg.norm(points - start - share[:, None] * way, axis=1) - radius)
        return np.array(solids)

    def __call__(self, points):
        distances = self.distances(points)
        nearest = distances.min(0)
        return nearest - np.log(np.exp(-self.BLEND * (distances - nearest)).sum(0)) / self.BLEND


LEG, HIP, FOOT, THICKNESS = 0.12, 0.7, 0.05, 0.06  # half the legs' distance, heights of their ends, radius


def trousers():
    """Two legs along z below a trunk; half as wide as high."""
    parts = [((side * LEG, 0, FOOT), (side * LEG, 0, HIP), THICKNESS) for side in (-1, 1)]
    parts += [((-LEG, 0, HIP), (LEG, 0, HIP), 0.09), ((0, 0, HIP), (0, 0, 1.2), 0.11)]
    return Capsules(parts, af.Frame([0, 0, 0.6], 0.8))


@nudges
def ring(half_width, half_depth, heights, around, flare=0.0):
    """A skirt: vertices (heights · around, 3) of an elliptic tube about z, and its edges (e, 2).

    `flare`: increase of the width from top to bottom, as a share of the width at the top.
    """
    angles = np.linspace(0, 2 * np.pi, around, endpoint=False)
    wider = 1 + flare * (np.max(heights) - heights) / np.ptp(heights)
    layers = [
        np.column_stack([w * half_width * np.cos(angles), w * half_depth * np.sin(angles), 0 * angles + z])
        for w, z in zip(wider, heights, strict=True)
    ]
    index = np.arange(len(heights) * around).reshape(len(heights), around)
    rounds = np.column_stack([index.ravel(), np.roll(index, -1, axis=1).ravel()])
    downs = np.column_stack([index[:-1].ravel(), index[1:].ravel()])
    return np.concatenate(layers), np.concatenate([rounds, downs])


# Figures of closed, intersecting parts, as game characters are built.

LEG_PLACE = 0.1  # distance of a leg from the middle


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
        parts[f"leg.{side}"] = ellipsoid((LEG_PLACE * x, 0, 0.3), (0.07, 0.07, 0.25), count)
        parts[f"shoe.{side}"] = ellipsoid(
            (LEG_PLACE * x, -0.08, 0.08), (LEG_PLACE + 0.015, 0.22, 0.08), count
        )
    sizes = [len(vertices) for vertices, _ in parts.values()]
    starts = np.cumsum([0, *sizes[:-1]])
    triangles = [faces + start for (_, faces), start in zip(parts.values(), starts, strict=True)]
    return (
        np.concatenate([v for v, _ in parts.values()]),
        np.concatenate(triangles),
        np.repeat(list(parts), sizes),
    )
