# SPDX-License-Identifier: GPL-3.0-or-later
"""What a wrap measures."""

from dataclasses import dataclass

from ._report import Report


@dataclass(frozen=True, kw_only=True)
class WrapReport(Report):
    """What wrap reached. Distances between the surfaces are shares of the target's diagonal."""

    to_target_mean: float
    """Mean distance from the wrapped surface, where it has a counterpart, to the target."""
    to_target_95: float
    """Distance that 95 % of it keep."""
    from_target_mean: float
    """Mean distance from the target to the wrapped surface."""
    from_target_95: float
    """Distance that 95 % of the target keep."""
    matched_share: float
    """Share of the surface that has a counterpart; 1 where the target is closed."""
    landmarks: tuple[float, ...]
    """Distance of each landmark to its place on the target, in mesh units."""
    diagonal: float
    """Of the target's bounding box, in mesh units."""
    scale: float
    """By which the surface as a whole has grown."""
    stretch: float
    """Mean ‖J − R‖², beside that scale."""
    bend: float
    """Mean squared speed at which the closest rotation R turns."""
    min_determinant: float
    """Smallest det J, beside the scale."""
    flipped_share: float
    """Share of samples where det J ≤ 0."""
    iterations: int
    seconds: float
    notes: tuple[str, ...] = ()
    """Sentences on what should not go unseen: unlike shapes, landmarks that do not fit, folds."""
