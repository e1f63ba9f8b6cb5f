# SPDX-License-Identifier: GPL-3.0-or-later
"""Classes of reports on contact."""

from dataclasses import dataclass

from ._report import Report


@dataclass(frozen=True, kw_only=True)
class HeldBack(Report):
    """A handle that contact prevents from reaching its target."""

    handle: int
    by: str
    """"obstacles[0]", say, or "ground"."""
    distance: float
    """Mean distance to the target, in mesh units."""


@dataclass(frozen=True, kw_only=True)
class ContactReport(Report):
    """Contact of a solved surface."""

    deepest: float
    """How far a sample is beyond an obstacle's margin, in mesh units."""
    touching: float
    """Share of the area that presses."""
    held: tuple[HeldBack, ...]
    crossing: tuple[str, ...]
    """"obstacles[0]", say: an obstacle that crosses the surface at rest; what is inside it stays."""
