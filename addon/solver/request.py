# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose that a solver turns into a shape, read on the main thread."""

from typing import NamedTuple

import numpy as np

from ..carried.carried_objects import CarriedPose
from .secondary_motion import SecondaryMotion


class StyleTerm(NamedTuple):
    """A style as the solver takes it; where two have the same `key`, they are equal."""

    key: tuple
    directions: object  # (k, 3) preferred normals in solve space, or the ObjectStyle there
    strength: float
    sharpness: float
    up: np.ndarray  # (3,)


class Request(NamedTuple):
    """One pose. Where two requests are alike, so are the shapes that are solved for them from rest."""

    targets: list  # of the handles: (4, 4), or (3,) for a point, in solve space
    style: StyleTerm | None
    points: np.ndarray  # (n, 3) the source's own, in local coordinates, where the field is evaluated
    handles: list  # at rest
    energy: dict  # weights of the energy's terms, by name
    carried: list  # carried.carried_objects.CarriedPose of what goes along
    motion: SecondaryMotion | None

    @property
    def style_key(self):
        return None if self.style is None else self.style.key

    def is_like(self, other):
        """Whether both ask for the same shape."""
        return (
            self.style_key == other.style_key
            and self.energy == other.energy
            and self.motion == other.motion
            and self.handles is other.handles
            and (self.points is other.points or np.array_equal(self.points, other.points))
            and len(self.carried) == len(other.carried)
            and all(map(CarriedPose.same, self.carried, other.carried))
            and len(self.targets) == len(other.targets)
            and all(map(np.array_equal, self.targets, other.targets))
        )
