# SPDX-License-Identifier: GPL-3.0-or-later
"""The published bunny under the same boxes by three methods: neural, radial, and libigl's mesh ARAP."""

import time

import numpy as np
import stage
from at_hand import data_folder
from shapes import Shape
from standing import enclosed

import arapfields as af

from .common import Box, add, add_boxes, turned

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


def render(output):
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
