# SPDX-License-Identifier: GPL-3.0-or-later
"""A source's points where the modifiers before the field have them, which may be off the surface at rest.

A field is solved on that surface and means little off it. So each point goes where the field takes its point
at rest, and its offset from there turns along with the field:

    y = f(r) + c + R (p - r - c),  R the rotation of f's Jacobian at r, c the median offset.

What has moved as a whole, by c, keeps its shape, however far it is.
"""

import numpy as np

from ..core.geometry import rotations


class PointsBefore:
    """(n, 3) points of a SourceSurface: `local`, and the same `now` in solve space."""

    def __init__(self, surface, local):
        self.local, self.rest, self.now = local, surface.vertices, surface.vertices
        self._turned, self._offsets = (), None
        if not np.array_equal(local, surface.local):
            self.now = surface.space.to_solve(local)
            offsets = self.now - self.rest
            offsets -= np.median(offsets, axis=0)
            self._turned = np.flatnonzero(offsets.any(axis=1))
            self._offsets = offsets[self._turned]

    @property
    def needs_field(self):
        return len(self._turned) > 0

    def moved(self, solved, field):
        """(n, 3) where they go, by where a field takes those at rest; those it leaves stay bit for bit."""
        if self.now is self.rest:
            return solved
        after = self.now.astype(solved.dtype) + (solved - self.rest.astype(solved.dtype))
        if self.needs_field:
            turns = rotations.closest(field.jacobian(self.rest[self._turned]))
            after[self._turned] += np.einsum("nij,nj->ni", turns - np.eye(3), self._offsets)
        return after
