# SPDX-License-Identifier: GPL-3.0-or-later
"""A source's points where the modifiers before the field have them, which may be off the surface at rest.

A field is solved on that surface and means little off it. So each point goes where the field takes its point
at rest, and its offset from there turns along with the field:

    y = f(r) + c + R (p - r - c),  R the rotation of f's Jacobian at r, c the median offset.

What has moved as a whole, by c, keeps its shape, however far it is.
"""

import numpy as np

from ..blender.vertex_groups import NearestVertices
from ..core.geometry import rotations


class PointsBefore:
    """(n, 3) points of a SourceSurface: `local`, and the same `now` in solve space."""

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
        """PointsBeside of (k, 3) points in solve space."""
        return PointsBeside(self, points)

    def turns(self, field):
        """(turned, 3) by how much more than at rest those go that turn: (R - 1) (p - r - c)."""
        if self._of[0] is not field:
            turns = rotations.closest(field.jacobian(self.rest[self.turned]))
            self._of = field, np.einsum("nij,nj->ni", turns - np.eye(3), self._offsets)
        return self._of[1]

    def moved(self, solved, field):
        """(n, 3) where they go, by where a field takes those at rest; those it leaves stay bit for bit."""
        if self.is_at_rest:
            return solved
        after = self.now.astype(solved.dtype) + (solved - self.rest.astype(solved.dtype))
        if self.needs_field:
            after[self.turned] += self.turns(field)
        return after


class PointsBeside:
    """(k, 3) points of others beside the surface as it is now, which go the way of its nearest points."""

    def __init__(self, before, points):
        self.before, self._near = before, NearestVertices(before.now, points)
        self._offsets = self._blend(before.now - before.rest)
        self.at_rest = points - self._offsets  # beside the surface at rest

    def moved(self, solved, field):
        """(k, 3) where they go, by where the body at rest takes those at rest."""
        turns = np.zeros_like(self.before.rest)
        if self.before.needs_field:
            turns[self.before.turned] = self.before.turns(field)
        return solved + self._offsets + self._blend(turns)

    def _blend(self, vectors):
        return np.stack([self._near.blend(column) for column in vectors.T], axis=1)
