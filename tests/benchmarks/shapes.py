# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes, solves and paired timings of the benchmarks."""

import functools
import os
import statistics
import sys
import time
from pathlib import Path

import numpy as np

import arapfields as af

# Paired timings: on a shared machine only ratios taken side by side mean anything.


def once(call):
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def paired(ours, theirs, rounds=5, warm_up=True):
    """Runs both calls alternately; returns row fields: median seconds of each and median ratio."""
    if warm_up:
        ours(), theirs()
    pairs = [(once(ours), once(theirs)) for _ in range(rounds)]
    return {
        "ours_s": round(statistics.median(a for a, _ in pairs), 5),
        "theirs_s": round(statistics.median(b for _, b in pairs), 5),
        "times_faster": round(statistics.median(b / a for a, b in pairs), 2),
    }


def first_good(solve, good, counts):
    """The smallest of `counts` for which solve(count) is good, or None; its seconds and report."""
    for count in counts:
        begin = time.perf_counter()
        field = solve(count)
        seconds = time.perf_counter() - begin
        if good(field):
            return count, seconds, field.report
    return None, seconds, field.report


def product_rate(size=256, rows=10_000, rounds=9):
    """Present GFLOP/s of single-precision matrix products of a network's size."""
    import torch

    a, b, c = torch.randn(rows, size), torch.randn(size, size), torch.empty(rows, size)
    torch.mm(a, b, out=c)
    seconds = statistics.median(once(lambda: torch.mm(a, b, out=c)) for _ in range(rounds))
    return 2e-9 * rows * size * size / seconds


# The shapes of the benchmarks, and their drags: published networks in ARAPFIELDS_DATA, else stand-ins.
#
# Their figures are not comparable, so rows of stand-ins have their names.

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "blender_scripts")]
from support.geometry import cases, meshes  # noqa: E402
from support.oracles import Network  # noqa: E402

OURS = {"bunny": "dinosaur", "spot": "dog", "hand": "hand", "whale": "lizard", "cube": "mug"}
CREATURES = ("dinosaur", "lizard", "octopus")
FULL = 70  # degrees of a whole drag
HALF_EXTENT = 0.75  # of stand-ins, as in fit_sdf, so that the networks' frame is the identity


def data():
    return Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))


def network_file(name):
    return data() / "neural_sdf" / f"{name}.pt"


def is_published(name):
    return network_file(name).is_file()


def label(name):
    """The shape's name in rows."""
    return name if is_published(name) else f"our {OURS[name]}"


@functools.cache
def own_mesh(name):
    """Vertices and triangles of a creature or a stand-in, centered, with largest half extent HALF_EXTENT."""
    import creatures

    shape = creatures.load(OURS.get(name, name))
    vertices = shape.vertices.astype(float)
    low, high = vertices.min(0), vertices.max(0)
    return HALF_EXTENT * (vertices - (low + high) / 2) / ((high - low).max() / 2), shape.triangles


@functools.cache
def layers(name):
    """Weights, biases, octaves, frequency, sharpness of the shape's network, of four layers of 256."""
    if is_published(name):
        return Network.published(network_file(name)).layers
    file = ROOT / "build" / "bench" / f"{OURS[name]}.npz"  # cached: a fit takes longer than most benchmarks
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        af.fit_sdf(*own_mesh(name), af.FitOptions(seed=0)).save(file)
    return af.NeuralSdf.load(file).layers


@functools.cache
def sdf(name):
    return af.NeuralSdf.from_layers(*layers(name))


@functools.cache
def samples(name, count=20000):
    """Uniform samples of the network's zero set, with frame identity."""
    return af.sample_surface(sdf(name), count=count, seed=0)


def mesh(name):
    """The published mesh of that name, or the stand-in's, with half extent HALF_EXTENT."""
    file = data() / "meshes" / f"{name}.obj"
    if not file.is_file():
        return own_mesh(name)
    vertices, triangles = meshes.read(file)
    centre = (vertices.min(0) + vertices.max(0)) / 2
    return (vertices - centre) / (np.ptp(vertices, 0).max() / (2 * HALF_EXTENT)), triangles


# Fixed box, moved box, axis and pivot of its rotation, in the network's cube.
PUBLISHED_DRAGS = {
    "bunny": ([[-1, -1, -1], [1, 1, -0.35]], [[-1, -1, 0.6], [1, 1, 1]], [0, 1, 0], (-0.1, 0, 0.3)),
    "spot": ([[-1, -1, -1], [1, 1, -0.35]], [[-1, 0.2, 0.25], [1, 1, 1]], [0, 0, 1], (0, 0.3, 0)),
    "hand": (
        [[-1, -1, -1], [0.1, 1, 0.03]],
        [[0, -0.2, 0.62], [0.4, 0.08, 0.9]],
        [0, 1, 0],
        (-0.1, -0.05, 0.05),
    ),
}
OUR_DRAGS = {
    "bunny": ([[-1, -1, -1], [1, 1, -0.2]], [[-1, -1, 0.25], [1, 0, 1]], [0, 0, 1], (0, -0.2, 0.2)),
    "spot": ([[-1, -1, -1], [1, 1, -0.25]], [[-1, -1, 0.2], [1, -0.3, 1]], [0, 0, 1], (0, -0.25, 0.2)),
    "hand": (
        [[-1, -1, -1], [1, 1, 0]],
        [[-0.12, -0.3, 0.55], [0.1, 0.3, 1]],
        [1, 0, 0],
        (-0.03, 0, 0.12),
    ),
}


def drag(name):
    return (PUBLISHED_DRAGS if is_published(name) else OUR_DRAGS)[name]


# The hand's fingertips; box and pivot of moved ones; axes of rotations sideways and forward.
PUBLISHED_HAND = {
    "tips": {
        "thumb": (0.33, -0.38, 0.1),
        "index": (0.22, -0.27, 0.56),
        "middle": (0.17, -0.06, 0.73),
        "ring": (0.24, 0.18, 0.62),
        "little": (0.16, 0.37, 0.35),
    },
    "index": ([[0, -0.4, 0.45], [0.4, -0.14, 0.7]], (-0.05, -0.2, 0.05)),
    "aside": [1, 0, 0],
    "forward": [0, 1, 0],
    "length": 1.48,
}
OUR_HAND = {
    "tips": {
        "thumb": (0.39, -0.1, 0.15),
        "index": (0.2, -0.03, 0.61),
        "middle": (-0.01, -0.03, 0.7),
        "ring": (-0.23, -0.03, 0.64),
        "little": (-0.42, -0.03, 0.52),
    },
    "index": ([[0.1, -0.3, 0.45], [0.4, 0.3, 1]], (0.1, 0, 0.12)),
    "aside": [0, 1, 0],
    "forward": [1, 0, 0],
    "length": 1.5,
}


def hand():
    return PUBLISHED_HAND if is_published("hand") else OUR_HAND


def placements(name):
    """(4, 4) boxes at rest: the fixed and the moved one."""
    return [cases.box(*corners) for corners in drag(name)[:2]]


def targets(name, degrees):
    """Targets for live.solve: the fixed box, and the moved one rotated by `degrees`."""
    held, moved = placements(name)
    return [held, cases.turn(drag(name)[2], degrees, drag(name)[3]) @ moved]


def handles(name, degrees=0.0):
    pairs = zip(placements(name), targets(name, degrees), strict=True)
    return [af.Cuboid(rest, target) for rest, target in pairs]


def surface(name, resolution):
    """Vertices and triangles of the shape."""
    return af.extract_surface(sdf(name), resolution)


def deformer(name, **options):
    return af.LiveDeformer(samples(name), handles(name), af.LiveOptions(**options))


class Clock:
    """Context manager: wall and processor seconds of a block; the latter do not depend on other load."""

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
