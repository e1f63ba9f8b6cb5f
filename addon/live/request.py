# SPDX-License-Identifier: GPL-3.0-or-later
"""What a live solver is asked for, read on the main thread."""

from typing import NamedTuple

import numpy as np

from ..carried.carried_objects import CarriedPose
from .body import Body


class Request(NamedTuple):
    """One pose. Where two requests are alike, so are the shapes that are solved for them from rest."""

    targets: list  # of the handles: (4, 4), or (3,) for a point, in solve space
    style: tuple | None  # (key, directions, strength, sharpness, up)
    points: np.ndarray  # (n, 3) the source's own, in local coordinates, where the field is evaluated
    handles: list  # at rest
    energy: dict  # weights of the energy's terms, by name
    carried: list  # carried.carried_objects.CarriedPose of what goes along
    body: Body | None = None  # what has secondary motion


def alike(a, b):
    """Whether two requests ask for the same."""
    if (a.style and a.style[0]) != (b.style and b.style[0]) or a.energy != b.energy:
        return False
    if a.body != b.body or a.handles is not b.handles or not same_points(a.points, b.points):
        return False
    if len(a.carried) != len(b.carried) or not all(map(CarriedPose.same, a.carried, b.carried)):
        return False
    return len(a.targets) == len(b.targets) and all(map(np.array_equal, a.targets, b.targets))


def same_points(a, b):
    return a is b or np.array_equal(a, b)
