# SPDX-License-Identifier: GPL-3.0-or-later
"""Helpers of tests of point caches."""

import numpy as np

from arapfields.point_cache import PointCacheWriter

POINTS, FRAMES = 7, 5


def random_motion():
    """(FRAMES, POINTS, 3) random positions."""
    return np.random.default_rng(0).normal(size=(FRAMES, POINTS, 3)).astype(np.float32)


def write(path, motion, **settings):
    with PointCacheWriter(path, motion.shape[1], len(motion), **settings) as cache:
        for positions in motion:
            cache.write(positions)
    return path


def names(folder):
    return sorted(path.name for path in folder.iterdir())
