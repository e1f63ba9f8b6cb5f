# SPDX-License-Identifier: GPL-3.0-or-later
"""Six shapes under cuboid handles: at rest above, deformed below; a handle keeps its colour."""

import stage

from .common import Box, add, add_boxes, deformed, measured, shape, stack, turned

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
            Box((0, 0, 0.30), (0.38, 0.38, 0.16)),
            Box((-1.0, -0.28, 0.14), (0.24, 0.30, 0.17), 65, "Y", (-0.42, -0.2, 0.25)),
            Box((1.0, -0.28, 0.14), (0.24, 0.30, 0.17), -65, "Y", (0.42, -0.2, 0.25)),
            Box((0, 0, 1.08), (0.44, 0.44, 0.28), 22, "Y", (0, 0, 0.75), (0.06, 0, 0.12)),
        ],
    ),
    "hand": (
        -8,
        [
            Box((0.0, 0.0, 0.08), (0.42, 0.24, 0.52)),
            Box((0.415, -0.04, 1.36), (0.14, 0.14, 0.15), 30, "Y", (0.29, 0.0, 0.78)),
            Box((0.63, -0.16, 0.74), (0.16, 0.15, 0.2), 30, "Y", (0.35, -0.05, 0.35)),
            Box((-0.415, -0.04, 1.24), (0.13, 0.14, 0.15), -30, "Y", (-0.29, 0.0, 0.76)),
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
# Fingers lie close together: a finer encoding and softer bends keep one from taking the others along.
FINER = {
    "frequency": 4.0,
    "octaves": 6,
    "bending": 0.1,
    "learning_rate": 0.02,
    "width": 128,
    "iterations": 200,
}
OPTIONS = {"hand": FINER}
SHEETS = {  # and where each stands
    "deformations": {"lizard": -2.5, "dinosaur": 0.0, "octopus": 2.4},
    "deformations_more": {"hand": -1.8, "mug": 0.0, "dog": 2.45},
}


def objects_of(names, shapes, targets):
    """A row of shapes with their boxes."""
    shown = []
    for name, x in names.items():
        degrees, boxes = CASES[name]
        place = turned(shape(name), x, degrees)
        shown.append(add(shapes[name], name, place))
        shown += add_boxes(boxes, place, targets)
    return shown


def render(output):
    results = {}
    for sheet, names in SHEETS.items():
        rest, moved = {name: shape(name) for name in names}, {}
        for name in names:
            field, moved[name] = deformed(rest[name], CASES[name][1], **OPTIONS.get(name, {}))
            results[name] = measured(field)
        stage.clear()
        rows = {"rest": objects_of(names, rest, False), "deformed": objects_of(names, moved, True)}
        stage.set_up([*rows["rest"], *rows["deformed"]], elevation=15)
        paths = []
        for drawn in rows:
            for row, objects in rows.items():
                for item in objects:
                    item.hide_render = row != drawn
            paths.append(output / f"{sheet}-{drawn}.png")
            stage.take(paths[-1])
        stack(paths, output / f"{sheet}.png")
    return results
