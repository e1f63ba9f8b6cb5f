# SPDX-License-Identifier: GPL-3.0-or-later
"""Helpers of the live benchmarks: a solver for a drag, a clock, vertices inside a box."""

import time

import numpy as np

import arapfields as af

from .shapes import FULL, cases, drag, hand, handles, label, placements, samples, sdf, targets

__all__ = ["FULL", "Clock", "cases", "deformer", "drag", "hand", "handles", "inside", "label", "placements"]
__all__ += ["samples", "surface", "targets", "volume"]


def surface(name, resolution):
    """Vertices and triangles of the shape."""
    return af.extract_surface(sdf(name), resolution)


def deformer(name, **options):
    return af.LiveDeformer(samples(name), handles(name), af.LiveOptions(**options))


class Clock:
    """Context manager: wall and processor seconds of a block; the latter do not depend on other load."""

    def __enter__(self):
        self.begin = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_):
        self.wall = time.perf_counter() - self.begin[0]
        self.cpu = time.process_time() - self.begin[1]


def inside(placement, points):
    local = (points - placement[:3, 3]) @ np.linalg.inv(placement[:3, :3]).T
    return np.abs(local).max(1) <= 1


def volume(vertices, triangles):
    return (
        np.einsum(
            "ij,ij->", vertices[triangles[:, 0]], np.cross(*(vertices[triangles[:, k]] for k in (1, 2)))
        )
        / 6
    )
