# SPDX-License-Identifier: GPL-3.0-or-later
"""Our own shapes, side by side."""

import stage

from .common import add, shape, turned

ROWS = (
    (("lizard", 38), ("octopus", 0), ("dog", 50), ("bar", 30)),
    (("hand", -8), ("dinosaur", 55), ("mug", 25), ("ring", 30)),
)


def render(output):
    stage.clear()
    shown, figures = [], {}
    for depth, row in enumerate(ROWS):
        for column, (name, degrees) in enumerate(row):
            made = shape(name)
            place = turned(made, 2.4 * column + 1.2 * depth, degrees, y=2.6 * depth)
            shown.append(add(made, name, place))
            figures[name] = {"vertices": len(made.vertices), "triangles": len(made.triangles)}
    stage.photograph(shown, output / "shapes.png", elevation=20)
    return figures
