# SPDX-License-Identifier: GPL-3.0-or-later
"""Moves the shapes of tests by a ten-millionth of their size: what a test finds must not depend on it.

ARAPFIELDS_NUDGE    number of a displacement; 0 or none leaves the shapes as they are
"""

import functools
import os

import numpy as np

NUMBER = int(os.environ.get("ARAPFIELDS_NUDGE") or 0)
SIZE = 1e-7


def nudged(points):
    """Points (n, 3) moved by at most SIZE of their extent; equal points move alike."""
    points = np.asarray(points, float)
    if not NUMBER or not len(points):
        return points
    size = np.ptp(points, axis=0).max() or 1.0
    rng = np.random.default_rng(NUMBER)
    waves, phases = rng.normal(size=(3, 3)) * 1000 / size, rng.uniform(0, 2 * np.pi, 3)
    return points + SIZE / np.sqrt(3) * size * np.sin(points @ waves + phases)


def nudges(function):
    """Has a function that returns points, or a tuple with points first, return them moved."""

    @functools.wraps(function)
    def inner(*arguments, **named):
        result = function(*arguments, **named)
        return (nudged(result[0]), *result[1:]) if isinstance(result, tuple) else nudged(result)

    return inner
