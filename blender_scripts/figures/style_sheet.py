# SPDX-License-Identifier: GPL-3.0-or-later
"""All styles of six shapes at full strength, as live styles show them: a row a shape, in two sheets."""

import numpy as np
import stage
import standing

import arapfields as af

from .common import add, samples_of, shape, stack, suzanne, turned, warped

ROWS = [("dog", 48), ("dinosaur", 55), ("lizard", 40), ("octopus", 0), ("suzanne", 28), ("chapel", 38)]
SPACING = 2.1
OPTIONS = {"samples": 3000, "coarse_centers": 100, "fine_centers": 500, "iterations": 60, "tolerance": 3e-4}
STYLES = af.style_names()
SHEETS = [STYLES[:7], STYLES[7:]]
ENDS = [(-0.5 * SPACING, 0.0, 0.5), (7.5 * SPACING, 0.0, 0.5)]


def solver(samples):
    """Live, with the weights that stylize has by default."""
    usual = af.StylizeOptions()
    weights = {name: getattr(usual, name) for name in ("bending", "barrier", "barrier_threshold")}
    return af.LiveDeformer(samples, options=af.LiveOptions(**OPTIONS, **weights, interior=False))


def stylized(rest, samples, live, style):
    """The shape in the style, and what it came to."""
    preferred = af.preferred_normals(style)
    live.reset()
    live.set_style(style)
    field = live.solve()
    moved = warped(rest, field)
    parts = standing.feet(rest.vertices, rest.triangles)
    figures = {
        "preference_rest": af.gauss_preference(samples.normals, preferred).mean(),
        "preference": live.report["preference"],
        "share_rest": standing.share_along(rest.vertices, rest.triangles, preferred),
        "share": standing.share_along(moved.vertices, rest.triangles, preferred),
        "tilt": standing.tilt(rest.vertices, moved.vertices, rest.triangles),
        "unevenness": standing.unevenness(moved.vertices, parts, np.ptp(rest.vertices[:, 2])),
        "volume": standing.enclosed(moved.vertices, rest.triangles)
        / standing.enclosed(rest.vertices, rest.triangles),
        "flipped_share": live.report["flipped_share"],
        "min_determinant": live.report["min_determinant"],
    }
    return moved, {name: round(float(value), 4) for name, value in figures.items()}


def place(made, rest, column, degrees):
    """In its column on the floor, at the scale at which the rest shape fills one."""
    turn = np.radians(degrees)
    width = np.ptp(rest.vertices[:, :2] @ (np.cos(turn), -np.sin(turn)))
    scale = min(1.8 / width, 1.9 / np.ptp(rest.vertices[:, 2]))
    return turned(made, column * SPACING, degrees, scale)


def render(output):
    rests = {name: suzanne() if name == "suzanne" else shape(name) for name, _ in ROWS}
    samples = {name: samples_of(rest) for name, rest in rests.items()}
    solvers = {name: solver(drawn) for name, drawn in samples.items()}
    results = {}
    for number, styles in enumerate(SHEETS, 1):
        paths = []
        for name, degrees in ROWS:
            rest = rests[name]
            stage.clear()
            shown = [add(rest, name, place(rest, rest, 0, degrees))]
            for column, style in enumerate(styles, 1):
                moved, results[f"{name}, {style}"] = stylized(rest, samples[name], solvers[name], style)
                shown.append(add(moved, style, place(moved, rest, column, degrees)))
                if name == ROWS[0][0]:
                    shown.append(stage.caption(style, (SPACING * column, 0.2, 2.05), 0.24))
            paths.append(output / f"style-sheet-{number}-{name}.png")
            stage.photograph(shown, paths[-1], elevation=12, around=ENDS, margin=0.01)
        stack(paths, output / f"style-sheet-{number}.png")
    return results
