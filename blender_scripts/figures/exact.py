# SPDX-License-Identifier: GPL-3.0-or-later
"""Soft handles beside exact ones: the same bar, the same boxes, and how far each is from its targets."""

import numpy as np
import stage

from .common import Box, add, add_boxes, deformed, measured, samples_of, shape, turned

BOXES = [
    Box((-0.60, 0, 0.12), (0.22, 0.17, 0.17)),
    Box((0.60, 0, 0.12), (0.22, 0.17, 0.17), 120, "X", None, (0.0, 0.0, 0.22)),
]
NEAR, FAR = np.array((0.72, 0.42, 0.08)), np.array((0.75, 0.02, 0.02))
WORST = 0.03  # distance from the target at which the colour is full


def distances(rest, moved):
    """How far each vertex inside a box at rest is from where the box takes it; 0 elsewhere."""
    off = np.zeros(len(rest.vertices))
    for box in BOXES:
        to_box = np.linalg.inv(np.array(box.rest))
        local = rest.vertices @ to_box[:3, :3].T + to_box[:3, 3]
        inside = (np.abs(local) <= 1).all(axis=1)
        target = np.array(box.target)
        goal = local @ target[:3, :3].T + target[:3, 3]
        off = np.where(inside, np.linalg.norm(moved.vertices - goal, axis=1), off)
    return off


def render(output):
    bar = shape("slender_bar")
    samples = samples_of(bar)
    stage.clear()
    place = turned(bar, 0.0, 16)
    shown = [
        add(bar, "rest", place),
        *add_boxes(BOXES, place, False),
        stage.caption("at rest", (0, -1, 0.0), 0.13),
    ]
    results = {}
    for column, (name, options) in enumerate((("soft", {}), ("exact", {"exact_handles": True})), 1):
        field, moved = deformed(bar, BOXES, samples, **options)
        off = distances(bar, moved)
        share = np.clip(off / WORST, 0, 1)[:, None]
        moved = moved._replace(colours=NEAR + (FAR - NEAR) * share)
        results[name] = {**measured(field), "largest_distance": float(f"{off.max():.2g}")}
        place = turned(bar, 2.1 * column, 16)
        shown += [add(moved, name, place), *add_boxes(BOXES, place, True)]
        text = f"{name}: off by at most {off.max():.2g}, E = {field.report['energy']:.3f}"
        shown.append(stage.caption(text, (2.1 * column, -1, 0.0), 0.13))
    stage.photograph(shown, output / "exact.png", elevation=16)
    return results
