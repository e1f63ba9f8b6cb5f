# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of handles, told apart on a grey or a dark viewport."""

PALETTE = (
    (0.27, 0.55, 1.00),  # blue
    (1.00, 0.42, 0.30),  # red
    (0.35, 0.80, 0.40),  # green
    (0.85, 0.45, 0.90),  # violet
    (1.00, 0.80, 0.25),  # yellow
    (0.25, 0.85, 0.85),  # turquoise
    (1.00, 0.60, 0.75),  # pink
    (0.65, 0.45, 0.20),  # brown
    (0.70, 0.95, 0.25),  # lime
    (0.55, 0.40, 1.00),  # indigo
    (1.00, 0.60, 0.10),  # orange
    (0.10, 0.55, 0.45),  # sea green
    (0.80, 0.75, 0.60),  # sand
    (0.85, 0.10, 0.45),  # crimson
    (0.65, 0.80, 1.00),  # sky
    (0.50, 0.55, 0.10),  # olive
    (0.60, 1.00, 0.75),  # mint
    (0.50, 0.15, 0.55),  # purple
    (0.10, 0.30, 0.70),  # navy
    (0.95, 0.95, 0.95),  # white
)


def next_colour(taken):
    """The first colour that the fewest of the `taken` ones, (r, g, b) each, are."""
    uses = [sum(is_same(colour, other) for other in taken) for colour in PALETTE]
    return PALETTE[uses.index(min(uses))]


def is_same(a, b):
    return all(abs(x - y) < 1e-3 for x, y in zip(a, b, strict=True))
