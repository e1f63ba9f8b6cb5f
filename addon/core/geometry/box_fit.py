# SPDX-License-Identifier: GPL-3.0-or-later
"""Boxes of handles that follow the surface inside them."""

import numpy as np

from .rotations import best_rotation

LEAST = 12  # least number of surface points for a pin's motion: in its box, else the nearest ones
MOST_SCALE = 5.0  # largest scale of a side, and inverse of the smallest


def followed_box(box, before, after, is_box=True):
    """(4, 4) box with orthogonal axes that follows a surface, given by (n, 3) points before and after.

    It rotates with the points inside, and each side is scaled with them, so that it still contains them; an
    empty box stays. A pin's box follows the nearest points if it contains few, and keeps its size.
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
