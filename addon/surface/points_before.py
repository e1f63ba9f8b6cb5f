# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of a source as the modifiers before the field move them, possibly off the surface at rest.

A field is solved on the surface at rest and is inaccurate off it. So each point follows its rest point r, and
its offset from r rotates with the field:

    y = f(r) + c + R (p - r - c),  R the rotation of f's Jacobian at r, c the median offset.

A translation c of all points is left out of the offsets, so that it does not rotate.
"""

import numpy as np

from ..blender.vertex_groups import NearestVertices
from ..core.geometry import rotations


class PointsBefore:
    """Points of a SourceSurface before the field: (n, 3) `local`, in solve space `now`, and `rest`."""

    def __init__(self, surface, local):
        self.local, self.rest, self.now = local, surface.vertices, surface.vertices
        self.turned, self._offsets, self._of = (), None, (None, None)
        if not np.array_equal(local, surface.local):
            self.now = surface.space.to_solve(local)
            offsets = self.now - self.rest
            offsets -= np.median(offsets, axis=0)
            self.turned = np.flatnonzero(offsets.any(axis=1))
            self._offsets = offsets[self.turned]

    @property
    def needs_field(self):
        return len(self.turned) > 0

    @property
    def is_at_rest(self):
        return self.now is self.rest

    def beside(self, points):
        """A PointsBeside for (k, 3) points in solve space."""
        return PointsBeside(self, points)

    def turns(self, field):
        """(k, 3) displacements (R - 1) (p - r - c) of the points `turned`, those with an offset."""
        if self._of[0] is not field:
            turns = rotations.closest(field.jacobian(self.rest[self.turned]))
            self._of = field, np.einsum("nij,nj->ni", turns - np.eye(3), self._offsets)
        return self._of[1]

    def moved(self, solved, field):
        """(n, 3) moved points; `solved`: the rest points moved by the field."""
        if self.is_at_rest:
            return solved
        after = self.now.astype(solved.dtype) + (solved - self.rest.astype(solved.dtype))
        if self.needs_field:
            after[self.turned] += self.turns(field)
        return after


class PointsBeside:
    """(k, 3) points near the surface before the field, which follow its nearest vertices."""

    def __init__(self, before, points):
        self.before, self._near = before, NearestVertices(before.now, points)
        self._offsets = self._blend(before.now - before.rest)
        self.at_rest = points - self._offsets  # near the surface at rest

    def moved(self, solved, field):
        """(k, 3) moved points; `solved`: the points `at_rest` moved by the field."""
        turns = np.zeros_like(self.before.rest)
        if self.before.needs_field:
            turns[self.before.turned] = self.before.turns(field)
        return solved + self._offsets + self._blend(turns)

    def _blend(self, vectors):
        return np.stack([self._near.blend(column) for column in vectors.T], axis=1)
