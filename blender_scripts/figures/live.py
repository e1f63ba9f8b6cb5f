# SPDX-License-Identifier: GPL-3.0-or-later
"""A handle dragged in small steps, the shape following live: six frames of the motion."""

import time
from statistics import median

import numpy as np
import stage

import arapfields as af

from .common import Box, add, add_boxes, samples_of, shape, turned, warped

FRAMES, STEPS, SPACING = 6, 12, 1.95
ANCHOR = Box((0, -0.02, 0.17), (0.45, 0.26, 0.2))


def head(share):
    """The dinosaur's head, part of the way: down to the left and round."""
    return Box((0, -0.72, 1.40), (0.28, 0.36, 0.30), -62 * share, "X", (0, -0.2, 1.0), (0.25 * share, 0, 0))


def tail(share):
    return Box((0, 1.27, 0.82), (0.16, 0.26, 0.18), 55 * share, "X", (0, 0.5, 0.75))


def render(output):
    dinosaur = shape("dinosaur")
    boxes = [ANCHOR, head(0), tail(0)]
    begin = time.perf_counter()
    live = af.LiveDeformer(samples_of(dinosaur), [box.handle for box in boxes])
    set_up = time.perf_counter() - begin
    stage.clear()
    shown, seconds = [], []
    for frame in range(FRAMES):
        if frame:
            for step in range(STEPS):
                share = (frame - 1 + (step + 1) / STEPS) / (FRAMES - 1)
                boxes = [ANCHOR, head(share), tail(share)]
                begin = time.perf_counter()
                field = live.solve([np.array(box.target) for box in boxes])
                seconds.append(time.perf_counter() - begin)
        moved = warped(dinosaur, field) if frame else dinosaur
        place = turned(dinosaur, SPACING * frame, 66, scale=0.8)
        shown.append(add(moved, f"frame {frame}", place))
        shown += add_boxes(boxes, place, True, edge=0.013)
    stage.photograph(shown, output / "live.png", elevation=10)
    report = live.report
    return {
        "solves": len(seconds),
        "median_solve_ms": round(1000 * median(seconds), 1),
        "set_up_s": round(set_up, 3),
        "energy": round(report.energy, 4),
        "min_determinant": round(report.min_determinant, 3),
    }
