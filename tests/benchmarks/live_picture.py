# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of docs/performance.md: python -m tests.benchmarks.live_picture (libigl, matplotlib, data)."""

from pathlib import Path

import numpy as np

from .live_cases import FULL, cases, deformer, placements, samples, surface, targets
from .live_compare import af, igl_arap, volume

ROOT = Path(__file__).resolve().parents[2]
CLAY, MOVED = np.array([0.80, 0.76, 0.70]), np.array([0.45, 0.62, 0.80])


def draw(axes, vertices, triangles, toward, title, colour=MOVED):
    """Draws flat-shaded triangles from direction `toward`, z up, from back to front."""
    toward = np.asarray(toward, float) / np.linalg.norm(toward)
    right = np.cross([0, 0, 1], toward)
    right /= np.linalg.norm(right)
    up = np.cross(toward, right)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    front = np.flatnonzero(normals @ toward > 0)
    front = front[np.argsort(corners[front].mean(1) @ toward)]
    light = toward + 0.6 * up - 0.5 * right
    shade = np.clip(0.35 + 0.65 * normals[front] @ light / np.linalg.norm(light), 0.1, 1)
    from matplotlib.collections import PolyCollection

    flat = np.stack([corners[front] @ right, corners[front] @ up], -1)
    axes.add_collection(PolyCollection(flat, facecolors=shade[:, None] * colour, edgecolors="face", lw=0.2))
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=10)
    axes.set_axis_off()
    axes.autoscale()


def main(resolution=80):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, places = plt.subplots(2, 3, figsize=(9, 7.2))
    vertices, triangles = surface("bunny", resolution)
    whole, view = volume(vertices, triangles), [0.25, -1, 0.15]
    theirs = igl_arap(vertices, triangles, placements("bunny"), targets("bunny", FULL))[0]
    ours = deformer("bunny").solve(targets("bunny", FULL))(vertices)
    draw(places[0, 0], vertices, triangles, view, "rest", CLAY)
    for place, moved, name in (
        (places[0, 1], ours, "live solver"),
        (places[0, 2], theirs, "libigl, ARAP of the mesh"),
    ):
        draw(place, moved, triangles, view, f"{name}: {volume(moved, triangles) / whole:.2f} of the volume")
    vertices, triangles = surface("hand", resolution)
    palm, finger = placements("hand")
    pair = [
        cases.moved(palm),
        cases.moved(finger, cases.turn([0, 1, 0], 50, (-0.1, -0.05, 0.05))),
    ]
    view = [1, 0.15, 0.1]
    draw(places[1, 0], vertices, triangles, view, "rest", CLAY)
    for place, interior, name in (
        (places[1, 1], True, "distances inside the shape"),
        (places[1, 2], False, "distances in space"),
    ):
        live = af.LiveDeformer(samples("hand"), pair, af.LiveOptions(interior=interior))
        field = live.solve(iterations=100)
        draw(place, field(vertices), triangles, view, f"{name}: E = {live.report['energy']:.4f}")
    figure.tight_layout()
    target = ROOT / "docs" / "images" / "live-compare.webp"
    figure.savefig(target, dpi=110, pil_kwargs={"quality": 95})
    print("wrote", target)


if __name__ == "__main__":
    main()
