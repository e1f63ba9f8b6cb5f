# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose that a solver turns into a shape, read on the main thread."""

import hashlib
from dataclasses import fields, is_dataclass
from typing import NamedTuple

import numpy as np

from ..carried.carrying import CarriedPose
from .contact import ContactTerm
from .secondary_motion import SecondaryMotion


class StyleTerm(NamedTuple):
    """A style's parameters for the solver; terms of equal `key` are equal."""

    key: tuple
    directions: object  # (k, 3) preferred normals in solve space, or the ObjectStyle there
    strength: float
    sharpness: float
    up: np.ndarray  # (3,)

    @property
    def what(self):
        """The key without strength and sharpness."""
        return self.key[:-2]


class Request(NamedTuple):
    """One pose. Requests that are alike have the same shape when solved from rest."""

    targets: list  # the handles' targets: (4, 4), or (3,) for a point, in solve space
    style: StyleTerm | None
    points: np.ndarray  # (n, 3) the source's points before the field, in local coordinates
    handles: list  # at rest
    energy: dict  # weights of the energy's terms, by name
    carried: list  # carried.carried_objects.CarriedPose of each carried object
    motion: SecondaryMotion | None
    contact: ContactTerm | None = None

    @property
    def style_key(self):
        return None if self.style is None else self.style.key

    @property
    def contact_key(self):
        return None if self.contact is None else self.contact.key

    def goes_on_from(self, earlier):
        """Whether a solve may start from the shape of an earlier one: handles or a slider are dragged."""
        what, before = (None if one.style is None else one.style.what for one in (self, earlier))
        return what == before

    def digest(self, *further):
        """Hash of the request and of `further`, parameters of its source; equal for equal shapes."""
        carried = [(pose.points, pose.rest, pose.now, pose.parent) for pose in self.carried]
        hashed = hashlib.sha1()
        parts = self.targets, self.style_key, self.points, self.handles, self.energy, carried, self.motion
        parts += (self.contact_key,)
        for part in flat((parts, further)):
            hashed.update(part)
        return hashed.hexdigest()

    def is_like(self, other):
        """Whether both ask for the same shape."""
        return (
            self.style_key == other.style_key
            and self.energy == other.energy
            and self.motion == other.motion
            and self.contact_key == other.contact_key
            and self.handles is other.handles
            and (self.points is other.points or np.array_equal(self.points, other.points))
            and len(self.carried) == len(other.carried)
            and all(map(CarriedPose.same, self.carried, other.carried))
            and len(self.targets) == len(other.targets)
            and all(map(np.array_equal, self.targets, other.targets))
        )


def flat(value):
    """Yields the bytes of a value, recursively through containers and dataclasses."""
    if isinstance(value, np.ndarray):
        yield value.tobytes()
    elif is_dataclass(value):
        yield from flat([getattr(value, one.name) for one in fields(value)])
    elif isinstance(value, dict):
        yield from flat(sorted(value.items()))
    elif isinstance(value, tuple | list):
        yield b"("
        for one in value:
            yield from flat(one)
    else:
        yield repr(value).encode()
