# SPDX-License-Identifier: GPL-3.0-or-later
"""All styles of six shapes as stylize makes them by default: a row a shape, in two sheets."""

import numpy as np
import stage
import standing

import arapfields as af

from .common import add, in_column, samples_of, shape, stack, suzanne, warped

ROWS = [("dog", 48), ("dinosaur", 55), ("lizard", 40), ("octopus", 0), ("suzanne", 28), ("chapel", 38)]
SPACING = 2.1
SAMPLES = 20000
STYLES = af.style_names()
SHEETS = [STYLES[:7], STYLES[7:]]
ENDS = [(-0.5 * SPACING, 0.0, 0.5), (7.5 * SPACING, 0.0, 0.5)]


def stylized(rest, samples, style):
    """The shape in the style, all options as they are by default, and what it came to."""
    preferred = af.preferred_normals(style)
    field = af.stylize(samples, style)
    moved = warped(rest, field)
    parts = standing.feet(rest.vertices, rest.triangles)
    before, after = rest.vertices, moved.vertices
    figures = {
        "preference_rest": af.gauss_preference(samples.normals, preferred).mean(),
        "preference": field.report.preference,
        "share_rest": standing.share_along(before, rest.triangles, preferred),
        "share": standing.share_along(after, rest.triangles, preferred),
        "tilt": standing.tilt(before, after, rest.triangles),
        "unevenness": standing.unevenness(after, standing.on_the_ground(before, parts), np.ptp(before[:, 2])),
        "volume": standing.enclosed(after, rest.triangles) / standing.enclosed(before, rest.triangles),
        "flipped_share": field.report.flipped_share,
        "min_determinant": field.report.min_determinant,
    }
    return moved, {name: round(float(value), 4) for name, value in figures.items()}


def render(output):
    rests = {name: suzanne() if name == "suzanne" else shape(name) for name, _ in ROWS}
    samples = {name: samples_of(rest, SAMPLES) for name, rest in rests.items()}
    results = {}
    for number, styles in enumerate(SHEETS, 1):
        paths = []
        for name, degrees in ROWS:
            rest = rests[name]
            stage.clear()
            shown = [add(rest, name, in_column(rest, rest, 0, degrees, SPACING))]
            for column, style in enumerate(styles, 1):
                moved, results[f"{name}, {style}"] = stylized(rest, samples[name], style)
                shown.append(add(moved, style, in_column(moved, rest, column, degrees, SPACING)))
                if name == ROWS[0][0]:
                    shown.append(stage.caption(style, (SPACING * column, 0.2, 2.05), 0.24))
            paths.append(output / f"style-sheet-{number}-{name}.png")
            stage.photograph(shown, paths[-1], elevation=12, around=ENDS, margin=0.01)
        stack(paths, output / f"style-sheet-{number}.png")
    return results
