# SPDX-License-Identifier: GPL-3.0-or-later
"""Six shapes under cuboid handles: at rest above, deformed below; a handle keeps its colour."""

import stage

from .common import Box, add, add_boxes, deformed, measured, shape, stack, turned

SPACING = 2.55

# shape: (turn on the table, handles); a box without a motion holds its part.
CASES = {
    "lizard": (
        62,
        [
            Box((0, 0.05, 0.2), (0.30, 0.30, 0.22)),
            Box((0, -0.93, 0.2), (0.24, 0.26, 0.2), -55, "X", (0, -0.45, 0.2)),
            Box((0.25, 1.48, 0.07), (0.38, 0.16, 0.12), 70, "X", (-0.1, 0.8, 0.15)),
        ],
    ),
    "dinosaur": (
        62,
        [
            Box((0, -0.02, 0.17), (0.45, 0.26, 0.2)),
            Box((0, -0.72, 1.40), (0.28, 0.36, 0.30), 45, "Z", (0, -0.5, 1.3), (0, -0.05, 0.28)),
            Box((0, 1.27, 0.82), (0.16, 0.26, 0.18), 50, "X", (0, 0.5, 0.75)),
        ],
    ),
    "octopus": (
        0,
        [
            Box((0, 0, 0.92), (0.44, 0.44, 0.42)),
            Box((-1.0, -0.28, 0.14), (0.24, 0.30, 0.17), 100, "Y", (-0.42, -0.2, 0.25)),
            Box((1.0, -0.28, 0.14), (0.24, 0.30, 0.17), -75, "Y", (0.42, -0.2, 0.25)),
        ],
    ),
    "hand": (
        -14,
        [
            Box((0.0, 0.0, 0.08), (0.42, 0.24, 0.52)),
            Box((0.375, -0.04, 1.36), (0.15, 0.15, 0.16), 75, "X", (0.30, 0.0, 0.95)),
            Box((0.63, -0.16, 0.74), (0.16, 0.15, 0.2), 40, "Y", (0.35, -0.05, 0.35)),
        ],
    ),
    "mug": (
        18,
        [
            Box((0.0, 0.0, 0.22), (0.56, 0.56, 0.26)),
            Box((0.83, 0.0, 0.62), (0.2, 0.16, 0.22), 0, "Y", None, (0.38, 0.0, 0.2)),
            Box((-0.1, 0.0, 1.12), (0.46, 0.56, 0.12), 24, "Z", (0, 0, 1.1), (0, 0, 0.1)),
        ],
    ),
    "dog": (
        52,
        [
            Box((0.0, 0.05, 0.21), (0.36, 0.66, 0.22)),
            Box((0.0, -0.76, 1.26), (0.34, 0.40, 0.34), -60, "Z", (0, -0.55, 1.1), (0.0, 0.0, 0.16)),
            Box((0.05, 0.70, 1.10), (0.16, 0.30, 0.20), -48, "X", (0, 0.6, 0.8)),
        ],
    ),
}
SHEETS = {"deformations": ["lizard", "dinosaur", "octopus"], "deformations_more": ["hand", "mug", "dog"]}


def row(names, shapes, targets, path):
    stage.clear()
    shown = []
    for column, name in enumerate(names):
        degrees, boxes = CASES[name]
        place = turned(shape(name), (column - (len(names) - 1) / 2) * SPACING, degrees)
        shown.append(add(shapes[name], name, place))
        shown += add_boxes(boxes, place, targets)
    stage.photograph(shown, path, size=(1200, 417), elevation=17)


def render(output):
    results = {}
    for sheet, names in SHEETS.items():
        rest = {name: shape(name) for name in names}
        moved = {}
        for name in names:
            field, moved[name] = deformed(rest[name], CASES[name][1])
            results[name] = measured(field)
        paths = [output / f"{sheet}-{row_name}.png" for row_name in ("rest", "deformed")]
        row(names, rest, False, paths[0])
        row(names, moved, True, paths[1])
        stack(paths, output / f"{sheet}.png")
    return results
