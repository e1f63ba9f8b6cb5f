# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of handles: distinct from each other, from a grey viewport and from Blender's selection orange."""

PALETTE = [
    *((0.27, 0.55, 1.0), (1.0, 0.42, 0.30), (0.35, 0.80, 0.40), (0.85, 0.45, 0.90), (1.0, 0.80, 0.25)),
    *((0.62, 0.92, 1.0), (0.55, 0.10, 1.0), (0.77, 0.18, 0.48), (0.62, 1.0, 0.10), (1.0, 0.70, 0.92)),
    *((0.48, 0.48, 0.25), (0.10, 0.77, 0.85), (0.10, 0.62, 0.10), (0.70, 0.62, 0.18), (0.48, 0.40, 0.62)),
    *((0.10, 1.0, 0.77), (1.0, 0.10, 0.70), (0.10, 0.55, 0.62)),
]


def free_colour(handles):
    """The colour that the fewest of these handles have."""
    counts = [sum(is_colour(entry.colour, colour) for entry in handles) for colour in PALETTE]
    return PALETTE[counts.index(min(counts))]


def is_colour(one, other):
    return max(abs(a - b) for a, b in zip(one, other, strict=True)) < 1e-3
