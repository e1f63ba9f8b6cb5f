# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes of the batch page, each in the style of a cube, as the batch's default makes it."""

import examples
import stage

import arapfields as af

from .common import add, samples_of, shape, turned, warped

SPACING, TURN = 1.9, 55


def render(output):
    stage.clear()
    shown, results = [], {}
    for column, name in enumerate(examples.MESHES):
        rest = shape(name)
        field = af.stylize(samples_of(rest, 20000), "cube")
        moved = warped(rest, field)
        results[name] = {"preference": round(field.report.preference, 3)}
        shown.append(add(moved, name, turned(moved, SPACING * column, TURN, 0.85)))
    stage.photograph(shown, output / "workflow-batch.png", width=1000, samples=16, elevation=12)
    return results
