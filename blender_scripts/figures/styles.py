# SPDX-License-Identifier: GPL-3.0-or-later
"""Gauss styles: a column a style with its preference on a sphere, a row a shape, in the radial field."""

import numpy as np
import stage

import arapfields as af

from .common import add, in_column, samples_of, shape, stack, suzanne, warped

STYLES = ["cube", "octahedron", "dodecahedron", "hexagonal prism", "square pyramid", "cylinder"]
ROWS = [("dog", 48), ("suzanne", 28), ("octopus", 0)]  # and its turn
SPACING, STRENGTH = 2.1, 0.6
ENDS = [(-0.5 * SPACING, 0.0, 0.5), ((len(STYLES) + 0.5) * SPACING, 0.0, 0.5)]  # of every row: columns align
OPTIONS = {
    "samples": 3000,
    "coarse_centers": 150,
    "fine_centers": 800,
    "bending": 0.1,
    "iterations": 40,
    "tolerance": 3e-4,
    "interior": False,  # a style acts everywhere alike: nothing is to be held apart
}
LOW, HIGH = np.array((0.012, 0.03, 0.12)), np.array((0.95, 0.34, 0.02))


def ball(colours_of, rings=64):
    """A sphere of the Shape kind, coloured by its normals."""
    from shapes import Shape

    u, v = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False))
    points = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], -1).reshape(-1, 3)
    a, i = np.meshgrid(np.arange(2 * rings), np.arange(rings), indexing="ij")
    b = (a + 1) % (2 * rings)
    one, two = a * (rings + 1) + i, b * (rings + 1) + i
    triangles = np.concatenate(
        [np.stack(t, -1).reshape(-1, 3) for t in ((one, one + 1, two), (two, one + 1, two + 1))]
    )
    return Shape(points, triangles, colours_of(points))


def preference_colours(style):
    def colours(normals):
        g = np.clip(af.gauss_preference(normals, af.preferred_normals(style)), 0, 1)[:, None]
        return LOW + (HIGH - LOW) * g**2

    return colours


def stylized(rest, live, style):
    live.reset()
    live.set_style(style, STRENGTH)
    field = live.solve()
    return warped(rest, field), {
        "preference_rest": round(
            float(np.mean(af.gauss_preference(live.normals, af.preferred_normals(style)))), 3
        ),
        "preference": round(live.deformer.report.preference, 3),
        "flipped_share": round(live.deformer.report.flipped_share, 4),
        "min_determinant": round(live.deformer.report.min_determinant, 3),
    }


class Live:
    """A live deformer with the normals of the samples it was given."""

    def __init__(self, samples):
        self.normals = samples.normals
        self.deformer = af.LiveDeformer(samples, options=af.LiveOptions(**OPTIONS))
        self.reset, self.set_style, self.solve = (
            self.deformer.reset,
            self.deformer.set_style,
            self.deformer.solve,
        )


def spheres(path):
    """The first row: each style's preference."""
    stage.clear()
    balls = [ball(preference_colours(style)) for style in STYLES]
    shown = [
        add(made, style, in_column(made, made, 1 + i, 25, SPACING))
        for i, (style, made) in enumerate(zip(STYLES, balls, strict=True))
    ]
    shown += [stage.caption(style, (SPACING * (1 + i), -0.9, -0.42), 0.24) for i, style in enumerate(STYLES)]
    shown.append(stage.caption("at rest", (0, -0.9, -0.42), 0.24))
    stage.photograph(shown, path, elevation=10, around=ENDS, margin=0.01)


def render(output):
    paths, results = [output / "styles-0.png"], {}
    spheres(paths[0])
    for name, degrees in ROWS:
        rest = suzanne() if name == "suzanne" else shape(name)
        live = Live(samples_of(rest))
        stage.clear()
        shown = [add(rest, name, in_column(rest, rest, 0, degrees, SPACING))]
        for column, style in enumerate(STYLES, 1):
            moved, results[f"{name}, {style}"] = stylized(rest, live, style)
            shown.append(add(moved, style, in_column(moved, rest, column, degrees, SPACING)))
        paths.append(output / f"styles-{name}.png")
        stage.photograph(shown, paths[-1], elevation=12, around=ENDS, margin=0.01)
    stack(paths, output / "styles.png")
    return results
