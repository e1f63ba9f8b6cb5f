# SPDX-License-Identifier: GPL-3.0-or-later
"""Boxes that go with the surface in them."""

import numpy as np

from .rotations import best_rotation

LEAST = 12  # points of the surface that tell how a pin moves: in its ball's box, or nearest to its middle
MOST_SCALE = 5.0  # of a side, up and down


def followed_box(box, before, after, is_box=True):
    """(4, 4) where a box of axes at right angles goes with a surface of (n, 3) points before and after.

    It turns with the points in it, and each side is scaled as they are along it, so that it holds them still;
    without any it stays. A pin's goes with the nearest points where few are in it, and keeps its size.
    """
    inside = (np.abs((before - box[:3, 3]) @ np.linalg.inv(box[:3, :3]).T) <= 1).all(axis=1)
    if is_box and not inside.any():
        return box
    if not is_box and inside.sum() < LEAST:
        inside = np.argsort(np.linalg.norm(before - box[:3, 3], axis=1), kind="stable")[:LEAST]
    before, after = before[inside], after[inside]
    turn = best_rotation(before, after)
    axes = box[:3, :3] / np.linalg.norm(box[:3, :3], axis=0)
    result = np.eye(4)
    result[:3, 3] = 0.0
    for k, (axis, turned) in enumerate(zip(axes.T, (turn @ axes).T, strict=True)):
        along, now, half, grown = before @ axis, after @ turned, np.linalg.norm(box[:3, k]), 1.0
        if is_box and np.ptp(along) > 1e-3 * half:
            grown = np.clip(np.ptp(now) / np.ptp(along), 1 / MOST_SCALE, MOST_SCALE)
        from_middle = box[:3, 3] @ axis - (along.min() + along.max()) / 2
        result[:3, 3] += ((now.min() + now.max()) / 2 + grown * from_middle) * turned
        result[:3, k] = grown * half * turned
    return result
