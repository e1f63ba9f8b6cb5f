# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture at the top of the README: a shape at rest with its handles, deformed, and in two styles."""

import stage
from mathutils import Vector

import arapfields as af

from .common import add, add_boxes, deformed, measured, samples_of, shape, turned, warped
from .deformations import CASES
from .styles import OPTIONS

SPACING = 2.15
TEXTS = ("at rest", "deformed", "cube style", "octahedron style")


def render(output):
    dinosaur, (_, boxes) = shape("dinosaur"), CASES["dinosaur"]
    samples = samples_of(dinosaur)
    field, moved = deformed(dinosaur, boxes, samples)
    live = af.LiveDeformer(samples, options=af.LiveOptions(**OPTIONS))
    results, shapes = {"deformed": measured(field)}, [dinosaur, moved]
    for style in ("cube", "octahedron"):
        live.reset()
        live.set_style(style, 0.7)
        shapes.append(warped(dinosaur, live.solve()))
        results[style] = {"preference": round(live.report.preference, 3)}
    stage.clear()
    shown = []
    for column, (made, text) in enumerate(zip(shapes, TEXTS, strict=True)):
        place = turned(dinosaur if column < 2 else made, SPACING * column, 58)
        shown.append(add(made, f"dinosaur {column}", place))
        under = place @ Vector((made.vertices.min(0) + made.vertices.max(0)) / 2)
        if column < 2:
            shown += add_boxes(boxes, place, column == 1)
        shown.append(stage.caption(text, (under.x, -1.6, -0.02), 0.17))
    stage.photograph(shown, output / "hero.png", width=1440, elevation=10)
    return results
