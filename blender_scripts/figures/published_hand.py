# SPDX-License-Identifier: GPL-3.0-or-later
"""The published hand, its index finger pulled by one point: how much the other fingers move."""

import numpy as np
import stage
from shapes import Shape

import arapfields as af

from .common import Box, add, add_boxes, measured, turned
from .published import published

PALM = Box((-0.13, 0.02, -0.36), (0.25, 0.45, 0.37))
TIP, GOAL = np.array((0.17, -0.26, 0.54)), np.array((0.50, -0.26, 0.28))
TIPS = {  # of the others: low corners and high corners
    "middle": ((-1, -0.16, 0.58), (1, 0.05, 1)),
    "ring": ((-1, 0.07, 0.46), (1, 0.26, 1)),
    "little": ((-1, 0.28, 0.22), (1, 1, 1)),
    "thumb": ((0.18, -1, -0.1), (1, -0.28, 0.2)),
}
STILL, FAR = np.array((0.62, 0.60, 0.56)), np.array((0.85, 0.06, 0.03))
FULL = 0.3  # distance at which the colour is full
OPTIONS = {  # fingers are a quarter of the cube apart: the second sees details of that size
    "default network": {},
    "finer encoding": {"frequency": 4.0, "octaves": 6, "bending": 0.1, "learning_rate": 0.02},
}
ITERATIONS = 80 if stage.DRAFT else 400
SPACING, RESOLUTION = 1.15, 64 if stage.DRAFT else 144


def shares(vertices, moved):
    """Mean distance that each other fingertip moved, over that of the tip that was pulled."""
    off = np.linalg.norm(moved - vertices, axis=1)
    pulled = off[np.linalg.norm(vertices - TIP, axis=1).argmin()]
    inside = {name: ((vertices >= low) & (vertices <= high)).all(1) for name, (low, high) in TIPS.items()}
    return {name: round(float(off[region].mean() / pulled), 3) for name, region in inside.items()}


def handles(target):
    return [PALM.handle, af.Point(TIP, target)]


def render(output):
    sdf = published("hand")
    vertices, triangles = af.extract_surface(sdf, RESOLUTION)
    samples = af.sample_surface(sdf, 20000)
    results, columns = {}, [("at rest", vertices)]
    for name, further in OPTIONS.items():
        field = af.deform(samples, handles(GOAL), af.DeformOptions(iterations=ITERATIONS, **further))
        columns.append((name, field(vertices)))
        results[name] = {**measured(field), "shares": shares(vertices, columns[-1][1])}
    live = af.LiveDeformer(samples, handles(TIP), af.LiveOptions())
    columns.append(("radial field", live.solve([np.array(PALM.target), GOAL])(vertices)))
    results[columns[-1][0]] = {"shares": shares(vertices, columns[-1][1])}
    stage.clear()
    shown = []
    for column, (text, moved) in enumerate(columns):
        share = np.clip(np.linalg.norm(moved - vertices, axis=1) / FULL, 0, 1)[:, None]
        made = Shape(moved, triangles, STILL + (FAR - STILL) * share)
        place = turned(Shape(vertices, triangles, made.colours), SPACING * column, -65)
        shown += [add(made, text, place), *add_boxes([PALM], place, column > 0, edge=0.006)]
        ball = Box(GOAL if column else TIP, (0.03, 0.03, 0.03))
        shown.append(stage.box("point", place @ ball.rest, stage.BOX_COLOURS[1], 0.006))
        shown.append(stage.caption(text, (SPACING * column, -0.8, 0.0), 0.09))
    stage.photograph(shown, output / "published_hand.png", elevation=8)
    return results
