# SPDX-License-Identifier: GPL-3.0-or-later
"""Backends: the same work by Eigen and by libtorch in turn, on two threads (make build BACKEND=eigen)."""

import functools
import os
import subprocess
import sys

import numpy as np

import arapfields as af

from . import shapes
from .shapes import Clock, deformer, targets

SITE = shapes.ROOT / "build/eigen/site"
ROUNDS = 3
COLUMNS = ("Eigen, processor s", "libtorch, processor s", "Eigen over libtorch")
DRAG = range(0, shapes.FULL + 1, 2)


@functools.cache
def live(name):
    solver = deformer(name)
    solver.solve(targets(name, 0))
    return solver


def drag(name):
    """Live steps of a drag there and back."""
    live(name).reset()
    for degrees in [*DRAG, *reversed(DRAG)]:
        live(name).solve(targets(name, degrees))


def deform(name, **options):
    af.deform(shapes.samples(name), shapes.handles(name, shapes.FULL), af.DeformOptions(**options))


def neural(batch):
    """Iterations of a network with `batch` samples."""
    deform("bunny", field="neural", batch=batch, iterations=max(4, 12000 // batch))


def wrap():
    (vertices, triangles), target = shapes.own_mesh("dog"), shapes.own_mesh("lizard")
    af.wrap(af.sample_mesh(vertices, triangles), af.MeshSdf(*target), [], af.WrapOptions(iterations=12))


WORK = {  # with the same numbers of steps: the end of a descent depends on rounding
    "default deform of the bunny": functools.partial(deform, "bunny", iterations=20),
    "default deform of spot": functools.partial(deform, "spot", iterations=20),
    "cube style of spot": lambda: af.stylize(
        shapes.samples("spot"), "cube", af.StylizeOptions(iterations=60)
    ),
    "live drag of the bunny": functools.partial(drag, "bunny"),
    "live drag of spot": functools.partial(drag, "spot"),
    "wrap of the dog onto the lizard": wrap,
    "fit of the bunny": lambda: af.fit_sdf(*shapes.mesh("bunny"), af.FitOptions(iterations=60)),
    "neural iterations, 300 samples": functools.partial(neural, 300),
    "neural iterations, 1,000 samples": functools.partial(neural, 1000),
    "neural iterations, 4,000 samples": functools.partial(neural, 4000),
}


def serve():
    """Runs the work named by each line of the input; prints its processor time in seconds."""
    for line in sys.stdin:
        with Clock() as clock:
            WORK[line.strip()]()
        print(clock.cpu, flush=True)


class Worker:
    """A process with one of the backends."""

    def __init__(self, path):
        paths = os.pathsep.join(filter(None, [str(path), os.environ.get("PYTHONPATH")]))
        command = [sys.executable, "-c", f"from {__name__} import serve; serve()"]
        self.process = subprocess.Popen(
            command,
            cwd=shapes.ROOT,
            env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "2"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def seconds(self, what):
        self.process.stdin.write(what + "\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())


def run():
    if not SITE.is_dir() or af.backend() != "torch":
        raise ModuleNotFoundError("needs both backends: make build, make build BACKEND=eigen")
    torch, eigen, rows = Worker(""), Worker(SITE), []
    for what in WORK:
        pairs = [(eigen.seconds(what), torch.seconds(what)) for _ in range(ROUNDS + 1)][1:]
        ratio = float(np.median([ours / theirs for ours, theirs in pairs]))
        numbers = (*np.min(pairs, axis=0).round(3).tolist(), round(ratio, 2))
        rows.append(dict(zip(("what", *COLUMNS), (what, *numbers), strict=True)))
    for worker in (torch, eigen):
        worker.process.communicate()
    return rows
