# SPDX-License-Identifier: GPL-3.0-or-later
"""One bar, its ends turned, under four weights of the bend; and stretch and bend over that weight."""

import numpy as np
import stage

import arapfields as af

from .common import Box, add, add_boxes, deformed, measured, samples_of, shape, turned

SPACING = 1.5
WEIGHTS = [0.0, 1e-3, 1e-2, 1e-1]
BOXES = [
    Box((-0.66, 0, 0.12), (0.16, 0.17, 0.17)),
    Box((0.66, 0, 0.12), (0.16, 0.17, 0.17), -90, "Y", (0.0, 0.0, 0.12), (0.05, 0.0, 0.05)),
]


def render(output):
    bar = shape("slender_bar")
    samples = samples_of(bar)
    stage.clear()
    shown, results = [], {}
    for column, weight in enumerate([None, *WEIGHTS]):
        at = SPACING * column + (0.3 if column else -0.1)
        place = turned(bar, at, 12)
        if weight is None:
            moved = bar
        else:
            field, moved = deformed(bar, BOXES, samples, bending=100 * weight, bending_unit="cube")
            stretch, bend = af.arap_energy(field, samples.points)
            results[f"{weight:g}"] = {**measured(field), "stretch": round(stretch, 5), "bend": round(bend, 4)}
        shown.append(add(moved, f"bar {weight}", place))
        shown += add_boxes(BOXES, place, weight is not None)
        text = "rest" if weight is None else f"λ = {weight:g}"
        shown.append(stage.caption(text, (at - (0.3 if column else 0.05), -1.0, 0.0), 0.14))
    stage.photograph(shown, output / "bending.png", elevation=14)
    plot(results, output / "bending-plot.png")
    return results


def plot(results, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, left = plt.subplots(figsize=(6.4, 3.2), dpi=150)
    right = left.twinx()
    at = np.arange(len(results))
    stretch, bend = ([row[name] for row in results.values()] for name in ("stretch", "bend"))
    (a,) = left.plot(at, stretch, "o-", color="#c2410c", label="mean stretch")
    (b,) = right.plot(at, bend, "s-", color="#1d4ed8", label="mean bend")
    left.set_xticks(at, [f"{float(weight):g}" for weight in results])
    left.set_xlabel("weight of the bend, λ")
    left.set_ylabel("stretch")
    right.set_ylabel("bend")
    left.set_ylim(bottom=0)
    right.set_ylim(bottom=0)
    left.legend(handles=[a, b], frameon=False, loc="upper center")
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)
