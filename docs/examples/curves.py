# SPDX-License-Identifier: GPL-3.0-or-later
"""Bends a drawn figure as rigidly as possible; makes docs/images/curves.webp.

python docs/examples/curves.py [output.webp]
"""

import sys
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

import arapfields as af

Array = npt.NDArray[np.float64]

BONES = [  # two ends and two radii: head, trunk, arms, legs
    ((0, 1.25), (0, 1.3), 0.42, 0.42),
    ((0, 0.75), (0, -0.35), 0.34, 0.38),
    ((-0.2, 0.6), (-1.25, 0.25), 0.22, 0.2),
    ((0.2, 0.6), (1.25, 0.25), 0.22, 0.2),
    ((-0.2, -0.4), (-0.5, -1.6), 0.25, 0.22),
    ((0.2, -0.4), (0.5, -1.6), 0.25, 0.22),
]
ROUNDING = 0.06
COLORS = ("black", "tab:red", "tab:orange", "tab:green")


def figure_distance(points: Array) -> Array:
    """About the distance to the figure's outline (p,), negative inside: a smooth union of capsules."""
    distances = []
    for start, end, ra, rb in BONES:
        a, b = np.array(start, float), np.array(end, float)
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        distances.append(np.linalg.norm(points - a - t[:, None] * (b - a), axis=1) - ra - t * (rb - ra))
    union: Array = -ROUNDING * np.log(np.sum(np.exp(-np.array(distances) / ROUNDING), axis=0))
    return union


def outline() -> Array:
    """The closed curve (m, 2) on which figure_distance vanishes."""
    x, y = np.linspace(-2, 2, 401), np.linspace(-2.2, 2.2, 441)
    nodes = np.stack(np.meshgrid(x, y), -1)
    values = figure_distance(nodes.reshape(-1, 2)).reshape(nodes.shape[:2])
    longest: Array = max(plt.contour(x, y, values, [0.0]).allsegs[0], key=len)
    return longest


def turn(degrees: float, pivot: tuple[float, float]) -> Array:
    """(3, 3): a rotation of the plane about a point."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    motion = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    motion[:2, 2] = np.asarray(pivot) - motion[:2, :2] @ pivot
    return motion


def shift(x: float, y: float) -> Array:
    return np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])


def draw_grid(axes: Any, field: af.CurveField | None) -> None:
    """Lines of the plane inside the figure, where the field takes them."""
    along, across = np.linspace(-2, 2, 400), np.arange(-2, 2.01, 0.1)
    for swap in (False, True):
        for offset in across:
            line = np.column_stack([along, np.full_like(along, offset)])
            line = line[:, ::-1] if swap else line
            moved = field(line) if field else line.copy()
            moved[figure_distance(line) > 0] = np.nan
            axes.plot(*moved.T, color="0.75", linewidth=0.6, zorder=1)


def main(output: str | Path) -> None:
    samples = af.sample_curve(outline(), 600)
    x, y = samples.points.T
    parts = {
        "held": (np.flatnonzero((abs(x) < 0.5) & (abs(y - 0.1) < 0.35)), np.eye(3)),
        "arm up": (np.flatnonzero(x > 1.1), turn(55, (0.45, 0.5))),
        "arm bent": (np.flatnonzero(x < -1.1), turn(60, (-0.75, 0.4))),
        "leg": (np.flatnonzero((x > 0) & (y < -1.5)), shift(0.6, 0.35)),
    }
    handles = [af.CurveHandle(indices, motion) for indices, motion in parts.values()]

    panels: list[tuple[str, af.CurveField | None]] = [("rest", None)]
    for bending in (0.001, 0.1):
        solved = af.deform_curve(samples.points, handles, af.CurveOptions(bending=bending))
        report = solved.report
        panels.append((f"bending {bending:g}: stretch {report.stretch:.3f}, bend {report.bend:.2f}", solved))
        print(f"bending {bending:g}: stretch {report.stretch:.4f}, bend {report.bend:.3f}, handles")
        print(f"  within {report.handle_error_max:.4f}, smallest det J {report.min_determinant:.2f}")

    plot, all_axes = plt.subplots(1, 3, figsize=(12, 4.8), layout="constrained")
    for axes, (title, field) in zip(all_axes, panels, strict=True):
        draw_grid(axes, field)
        closed = np.vstack([samples.points, samples.points[:1]])
        axes.plot(*(field(closed) if field else closed).T, color="tab:blue", linewidth=2, zorder=2)
        for (name, (indices, _)), color in zip(parts.items(), COLORS, strict=True):
            points = samples.points[indices]
            moved = field(points) if field else points
            axes.scatter(*moved.T, s=14, color=color, label=name, zorder=3)
        axes.set(title=title, xlim=(-2, 2), ylim=(-2.1, 2.3), aspect="equal", xticks=[], yticks=[])
    all_axes[0].legend(loc="lower left", frameon=False, fontsize=8)
    plot.savefig(output, dpi=110, pil_kwargs={"quality": 95})


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1] / "images" / "curves.webp")
