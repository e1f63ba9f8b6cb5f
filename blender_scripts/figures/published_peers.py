# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's figures 6 and 7 with its competitor, from what make bench PEERS=path left in build/bench."""

import numpy as np
import stage
from at_hand import PEERS
from shapes import Shape

from .common import add, stack, turned

METHODS = {
    "ours,-default": "ours",
    "implicit-arap": "implicit-arap",
    "libigl,-ARAP-of-the-mesh": "libigl's ARAP",
    "Blender,-Laplacian-Deform": "Laplacian Deform",
    "Blender,-Lattice": "Lattice",
    "Blender,-Surface-Deform": "Surface Deform",
}
ROWS = {"hand": (-65, 1.15, 0.09), "bunny": (0, 1.9, 0.14)}  # turn, spacing, size of captions
STILL, FAR = np.array((0.62, 0.60, 0.56)), np.array((0.85, 0.06, 0.03))
FULL = 0.3  # distance at which the colour is full


def row(shape):
    """(caption, vertices, triangles) at rest and by each method that has a result."""
    found = []
    for name, caption in METHODS.items():
        path = PEERS / f"moved-{shape}-{name}.npz"
        if path.exists():
            kept = np.load(path)
            found = found or [("at rest", kept["vertices"], kept["triangles"])]
            found.append((caption, kept["moved"], kept["triangles"]))
    return found


def render(output):
    paths, results = [], {}
    for shape, (degrees, spacing, size) in ROWS.items():
        columns = row(shape)
        if not columns:
            raise FileNotFoundError(f"no results of the {shape} in {PEERS}: make bench PEERS=path")
        stage.clear()
        shown, rest = [], columns[0][1]
        for column, (text, moved, triangles) in enumerate(columns):
            share = np.clip(np.linalg.norm(moved - rest, axis=1) / FULL, 0, 1)[:, None]
            colours = STILL + (FAR - STILL) * share
            place = turned(Shape(rest, triangles, colours), spacing * column, degrees)
            shown.append(add(Shape(moved, triangles, colours), text, place))
            shown.append(stage.caption(text, (spacing * column, -1.2, 0.0), size))
        paths.append(output / f"published_peers-{shape}.png")
        stage.photograph(shown, paths[-1], elevation=8)
        results[shape] = [text for text, _, _ in columns]
    stack(paths, output / "published_peers.png")
    return results
