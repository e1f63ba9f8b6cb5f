# SPDX-License-Identifier: GPL-3.0-or-later
"""Classes of reports on contact."""

from dataclasses import dataclass

from ._report import Report


@dataclass(frozen=True, kw_only=True)
class HeldBack(Report):
    """A handle that contact prevents from reaching its target."""

    handle: int
    by: str
    """Such as "obstacles[0]" or "ground"."""
    distance: float
    """Mean distance to the target, in mesh units."""


@dataclass(frozen=True, kw_only=True)
class ContactReport(Report):
    """Contact of a solved surface."""

    deepest: float
    """Largest penetration of a sample beyond an obstacle's margin, in mesh units."""
    touching: float
    """Share of the area in contact."""
    held: tuple[HeldBack, ...]
    crossing: tuple[str, ...]
    """Obstacles, such as "obstacles[0]", that cross the surface at rest; points inside them stay."""
    self_intersections: int | None
    """Pairs of the mesh's triangles that pass through each other and do not at rest, of parts that are far
    from each other there. None without `itself`, for samples that know no mesh, and after step()."""
