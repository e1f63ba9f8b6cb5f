# SPDX-License-Identifier: GPL-3.0-or-later
"""Published shapes with handles that a live drag moves, for the live benchmarks."""

import os
import sys
import time
from pathlib import Path

import numpy as np

import arapfields as af

sys.path.insert(0, str(Path(__file__).parents[1]))
import cases
from network_oracle import Network

FULL = 70  # degrees of a whole drag
# Box held, box moved, axis and pivot of its turn.
DRAGS = {
    "bunny": ([[-1, -1, -1], [1, 1, -0.35]], [[-1, -1, 0.6], [1, 1, 1]], [0, 1, 0], (-0.1, 0, 0.3)),
    "spot": ([[-1, -1, -1], [1, 1, -0.35]], [[-1, 0.2, 0.25], [1, 1, 1]], [0, 0, 1], (0, 0.3, 0)),
    "hand": (
        [[-1, -1, -1], [0.1, 1, 0.03]],
        [[0, -0.2, 0.62], [0.4, 0.08, 0.9]],
        [0, 1, 0],
        (-0.1, -0.05, 0.05),
    ),
}
FINGERTIPS = {
    "thumb": (0.33, -0.38, 0.1),
    "index": (0.22, -0.27, 0.56),
    "middle": (0.17, -0.06, 0.73),
    "ring": (0.24, 0.18, 0.62),
    "little": (0.16, 0.37, 0.35),
}


def path(name):
    return Path(os.environ["ARAPFIELDS_DATA"]) / "neural_sdf" / f"{name}.pt"


def samples(name, count=20000):
    return cases.published_samples(path(name), count)


def surface(name, resolution):
    """Vertices and triangles of the published shape."""
    return af.extract_surface(af.NeuralSdf.from_layers(*Network.published(path(name)).layers), resolution)


def rests(name):
    return [cases.box(*corners) for corners in DRAGS[name][:2]]


def targets(name, degrees):
    """What live.solve takes: the held box, and the moved one after a turn by so many degrees."""
    held, moved = rests(name)
    return [held, cases.turn(DRAGS[name][2], degrees, DRAGS[name][3]) @ moved]


def handles(name, degrees=0.0):
    pairs = zip(rests(name), targets(name, degrees), strict=True)
    return [af.Cuboid(rest, target) for rest, target in pairs]


def deformer(name, **options):
    return af.LiveDeformer(samples(name), handles(name), af.LiveOptions(**options))


class Clock:
    """Wall and processor seconds of a block: the second is the same on a busy machine."""

    def __enter__(self):
        self.begin = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_):
        self.wall = time.perf_counter() - self.begin[0]
        self.cpu = time.process_time() - self.begin[1]


def inside(placement, points):
    local = (points - placement[:3, 3]) @ np.linalg.inv(placement[:3, :3]).T
    return np.abs(local).max(1) <= 1


def volume(vertices, triangles):
    return (
        np.einsum(
            "ij,ij->", vertices[triangles[:, 0]], np.cross(*(vertices[triangles[:, k]] for k in (1, 2)))
        )
        / 6
    )
