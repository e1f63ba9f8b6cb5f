# SPDX-License-Identifier: GPL-3.0-or-later
"""Projection to region pixels, from the bottom left, by the view's perspective matrix."""

import numpy as np


def project(perspective, size, points):
    """(n, 2) pixels of (n, 3) points in world space, NaN for points behind the viewer.


    `perspective` is the (4, 4) matrix of the view (world → clip space), `size` the region's width and height.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    perspective = np.asarray(perspective, dtype=np.float64)
    clip = points @ perspective[:, :3].T + perspective[:, 3]
    depth = np.where(clip[:, 3:] > 0, clip[:, 3:], np.nan)
    return (clip[:, :2] / depth + 1) / 2 * np.asarray(size, dtype=np.float64)


def pixel_size(perspective, size, point):
    """World length of a pixel at the depth of a point (3,)."""
    perspective = np.asarray(perspective, dtype=np.float64)
    depth = perspective[3, :3] @ np.asarray(point, dtype=np.float64) + perspective[3, 3]
    return abs(depth) / (np.linalg.norm(perspective[0, :3]) * size[0] / 2)


def nearest(places, pixel, reach):
    """Index of the (n, 2) position nearest to a pixel, or -1 if none is within `reach` pixels."""
    if not len(places):
        return -1
    away = np.linalg.norm(np.asarray(places) - pixel, axis=1)
    away = np.where(np.isnan(away), np.inf, away)
    best = int(away.argmin())
    return best if away[best] <= reach else -1


def foremost(perspective, size, points, towards, pixel, reach):
    """Index of the foremost point among those within `reach` pixels of a pixel, or -1.

    `perspective`: (4, 4) from the points' space to clip space, `towards`: (3,) direction to the viewer in it.
    """
    rows, size = np.asarray(perspective, dtype=np.float32)[[0, 1, 3]], np.asarray(size, dtype=np.float32)
    clip = points @ rows[:, :3].T + rows[:, 3]
    depth = clip[:, 2:]
    away = (clip[:, :2] - depth * (2 * np.asarray(pixel, dtype=np.float32) / size - 1)) * (size / 2)
    met = np.flatnonzero(((away**2).sum(axis=1) <= (reach * depth[:, 0]) ** 2) & (depth[:, 0] > 0))
    return int(met[(points[met] @ towards).argmax()]) if len(met) else -1


def turn_between(center, before, after):
    """The angle (radians, counter-clockwise, -π to π) about a pixel from one pixel to another."""
    a, b = np.subtract(before, center), np.subtract(after, center)
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
