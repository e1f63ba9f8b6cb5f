# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the published networks, by several methods; written outside the repository."""

import time

import numpy as np
import stage
from at_hand import PEERS, data_folder
from shapes import Shape, enclosed

import arapfields as af

from .common import Box, add, add_boxes, measured, stack, turned

# The published bunny under the same boxes by three methods: neural, radial, and libigl's mesh ARAP.

BOXES = [
    Box((0.18, -0.02, -0.445), (0.66, 0.46, 0.105)),
    Box((-0.18, 0.22, 0.765), (0.41, 0.49, 0.175), 70, "Y", (-0.1, 0, 0.3)),
]
SPACING, RESOLUTION = 2.0, 64 if stage.DRAFT else 128
ITERATIONS = 400  # of libigl's local and global steps


def published(name):
    """A network of the authors, from ../shared/data or ARAPFIELDS_DATA."""
    import torch

    state = torch.load(data_folder() / "neural_sdf" / f"{name}.pt", map_location="cpu", weights_only=True)
    layers = sorted({int(key.split(".")[2]) for key in state})
    weights = [state[f"net.net.{i}.weight"].double().numpy() for i in layers]
    biases = [state[f"net.net.{i}.bias"].double().numpy() for i in layers]
    return af.NeuralSdf.from_layers(weights, biases)


def by_mesh(vertices, triangles):
    """libigl's ARAP, spokes and rims, with the vertices in the boxes as constraints."""
    import igl

    constrained, goals = [], []
    for box in BOXES:
        to_box = np.linalg.inv(np.array(box.rest))
        local = vertices @ to_box[:3, :3].T + to_box[:3, 3]
        inside = np.flatnonzero((np.abs(local) <= 1).all(axis=1))
        target = np.array(box.target)
        constrained.append(inside)
        goals.append(local[inside] @ target[:3, :3].T + target[:3, 3])
    data = igl.ARAPData()
    data.energy = igl.ARAP_ENERGY_TYPE_SPOKES_AND_RIMS
    data.max_iter = ITERATIONS
    igl.arap_precomputation(
        vertices, triangles.astype(np.int64), 3, np.concatenate(constrained).astype(np.int32), data
    )
    moved = vertices.copy(order="F")
    solved = igl.arap_solve(np.concatenate(goals), data, moved)
    return moved if solved is None else solved


def timed(call):
    begin = time.perf_counter()
    result = call()
    return result, time.perf_counter() - begin


def draw_published(output):
    sdf = published("bunny")
    vertices, triangles = af.extract_surface(sdf, RESOLUTION)
    samples = af.sample_surface(sdf, 20000)
    held = [box.handle for box in BOXES]
    start = [af.Cuboid(np.array(box.rest), np.array(box.rest)) for box in BOXES]

    def neural():
        return af.deform(samples, held)(vertices)

    def radial():
        return af.LiveDeformer(samples, start).solve([np.array(box.target) for box in BOXES])(vertices)

    columns, results = [("at rest", vertices)], {"triangles": len(triangles)}
    for name, call in (
        ("neural", neural),
        ("radial", radial),
        ("mesh", lambda: by_mesh(vertices, triangles)),
    ):
        moved, seconds = timed(call)
        share = enclosed(moved, triangles) / enclosed(vertices, triangles)
        results[name] = {"seconds": round(seconds, 2), "volume": round(share, 3)}
        columns.append((f"{name}: volume × {share:.2f}", moved))
    stage.clear()
    shown = []
    for column, (text, moved) in enumerate(columns):
        made = Shape(moved, triangles, np.tile(stage.RESULT if column else stage.CLAY, (len(moved), 1)))
        place = turned(Shape(vertices, triangles, made.colours), SPACING * column, 0)
        shown += [add(made, text, place), *add_boxes(BOXES, place, column > 0, edge=0.008)]
        shown.append(stage.caption(text, (SPACING * column, -1.9, 0.0), 0.15))
    stage.photograph(shown, output / "published.png", elevation=10)
    return results


# The published hand, its index finger pulled by one point: how much the other fingers move.

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
HAND_ITERATIONS = 80 if stage.DRAFT else 400
HAND_SPACING, HAND_RESOLUTION = 1.15, 64 if stage.DRAFT else 144


def shares(vertices, moved):
    """Mean distance that each other fingertip moved, over that of the tip that was pulled."""
    off = np.linalg.norm(moved - vertices, axis=1)
    pulled = off[np.linalg.norm(vertices - TIP, axis=1).argmin()]
    inside = {name: ((vertices >= low) & (vertices <= high)).all(1) for name, (low, high) in TIPS.items()}
    return {name: round(float(off[region].mean() / pulled), 3) for name, region in inside.items()}


def handles(target):
    return [PALM.handle, af.Point(TIP, target)]


def draw_published_hand(output):
    sdf = published("hand")
    vertices, triangles = af.extract_surface(sdf, HAND_RESOLUTION)
    samples = af.sample_surface(sdf, 20000)
    results, columns = {}, [("at rest", vertices)]
    for name, further in OPTIONS.items():
        field = af.deform(samples, handles(GOAL), af.DeformOptions(iterations=HAND_ITERATIONS, **further))
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
        place = turned(Shape(vertices, triangles, made.colours), HAND_SPACING * column, -65)
        shown += [add(made, text, place), *add_boxes([PALM], place, column > 0, edge=0.006)]
        ball = Box(GOAL if column else TIP, (0.03, 0.03, 0.03))
        shown.append(stage.box("point", place @ ball.rest, stage.BOX_COLOURS[1], 0.006))
        shown.append(stage.caption(text, (HAND_SPACING * column, -0.8, 0.0), 0.09))
    stage.photograph(shown, output / "published_hand.png", elevation=8)
    return results


# The paper's figures 6 and 7 with its competitor, from what make bench PEERS=path left in build/bench.

METHODS = {
    "ours,-default": "ours",
    "implicit-arap": "implicit-arap",
    "libigl,-ARAP-of-the-mesh": "libigl's ARAP",
    "Blender,-Laplacian-Deform": "Laplacian Deform",
    "Blender,-Lattice": "Lattice",
    "Blender,-Surface-Deform": "Surface Deform",
}
ROWS = {"hand": (-65, 1.15, 0.09), "bunny": (0, 1.9, 0.14)}  # turn, spacing, size of captions


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


def draw_published_peers(output):
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
