# SPDX-License-Identifier: GPL-3.0-or-later
"""Our own shapes, side by side."""

import menagerie
import stage

from .common import add, shape, turned


def render(output):
    stage.clear()
    shown, figures = [], {}
    for number, name in enumerate(menagerie.SHAPES):
        made = shape(name)
        place = turned(2.3 * (number % 4), 35, scale=0.9, y=-2.4 * (number // 4))
        shown.append(add(made, name, place))
        figures[name] = {"vertices": len(made.vertices), "triangles": len(made.triangles)}
    stage.photograph(shown, output / "shapes.png", size=(1440, 640), elevation=26)
    return figures
