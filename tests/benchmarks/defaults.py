# SPDX-License-Identifier: GPL-3.0-or-later
"""Deform with its defaults: how soon there is a first result and the last, and how good they are.

Seconds count from the press on: sampling, thickness, centers, solving, moving all vertices. On a shared
machine the processor's seconds, which two threads divide, say more than the clock's. Energies are means over
50,000 fresh samples, divided by the reference's.
"""

import threading
import time

import numpy as np

import arapfields as af
from arapfields._native import testing

from . import shapes
from .shapes import cases

VERTICES, FRESH, FRESH_SEED = 50_000, 50_000, 99
# The first result, as in native/solve/radial/full_solve.cpp.
FEW = {
    "fine_centers": 500,
    "coarse_centers": 100,
    "samples": 5000,
    "handle_samples": 1024,
    "iterations": 20,
}
REFERENCE_SAMPLES = 40_000  # samples for that many centers
REFERENCE = af.DeformOptions(field="radial", centers=2900, iterations=2000)
# Fixed box, moved box, axis and pivot of its rotation by FULL degrees, for a half extent of 0.75.
DRAGS = {
    "shiba": ([[-1, -1, -1], [1, 1, -0.2]], [[0, -1, 0.2], [1, 1, 1]], [0, 0, 1], (0.3, 0, 0.2)),
    "dinosaur": shapes.OUR_DRAGS["bunny"],
    "lizard": ([[-1, -0.4, -1], [1, 0.05, 1]], [[-1, 0.45, -1], [1, 1, 1]], [0, 0, 1], (0, 0.2, 0)),
    "octopus": (
        [[-0.3, -0.3, -0.2], [0.3, 0.3, 0.1]],
        [[-1, -0.3, -1], [-0.5, 0.3, 1]],
        [0, 1, 0],
        (-0.3, 0, -0.2),
    ),
}


def surface(name):
    """A mesh with about VERTICES vertices."""
    sdf = af.MeshSdf(*shapes.own_mesh(name)) if name in shapes.CREATURES else shapes.sdf(name)
    rough, _ = af.extract_surface(sdf, 64)
    return af.extract_surface(sdf, round(64 * (VERTICES / len(rough)) ** 0.5))


def handles_of(name):
    held, moved, axis, pivot = DRAGS[name] if name in DRAGS else shapes.drag(name)
    pose = cases.turn(axis, shapes.FULL, pivot)
    return [cases.moved(cases.box(*held)), cases.moved(cases.box(*moved), pose)]


class Yardstick:
    """Measures fields of one shape: energy and folds at new samples, and errors of handles."""

    def __init__(self, mesh, handles):
        self.fresh = af.sample_mesh(*mesh, count=FRESH, seed=FRESH_SEED)
        self.bending = testing.bending(self.fresh, af.DeformOptions())
        self.places = np.ascontiguousarray(self.fresh.points)
        self.handles, self.size = handles, np.linalg.norm(np.ptp(mesh[0], axis=0))

    def energy(self, field):
        first, second = field.jacobian(self.places), self.fresh.frame.scale * field.hessian(self.places)
        columns = [first[:, :, 0] * 0, *(first[:, :, k] for k in range(3))]
        columns += [second[:, :, j, k] for j, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        jets = np.ascontiguousarray(np.stack(columns))
        energy, _ = testing.arap_energy_by_points(jets, 1.0, np.ones(FRESH), self.bending)
        return energy, float((np.linalg.det(first) <= 0).mean())

    def handle_error(self, field):
        """Mean over handles of the mean distance to the targets, as a share of the shape's diagonal."""
        errors = []
        for handle in self.handles:
            local = (self.places - handle.rest[:3, 3]) @ np.linalg.inv(handle.rest[:3, :3]).T
            inside = self.places[np.abs(local).max(1) <= 1]
            wanted = inside @ handle.motion[:3, :3].T + handle.motion[:3, 3]
            errors.append(np.linalg.norm(field(inside) - wanted, axis=1).mean())
        return float(np.mean(errors)) / self.size


class Press:
    """A default deform of the mesh, with the times of its first and its last result since the press."""

    def __init__(self, mesh, handles, options):
        task, begin, ended = af.Task(), (time.perf_counter(), time.process_time()), threading.Event()
        task.watch(mesh[0], 0.0)
        self.first = None

        def wait():
            while self.first is None and not ended.wait(0.002):
                if task.looks:
                    self.first = self.since(begin)

        watcher = threading.Thread(target=wait)
        watcher.start()
        try:
            samples = af.sample_mesh(*mesh)
            self.field = af.deform(samples, handles, options, task=task)
            self.vertices = self.field(mesh[0])
            self.last = self.since(begin)
        finally:
            ended.set()
            watcher.join()

    @staticmethod
    def since(begin):
        return time.perf_counter() - begin[0], time.process_time() - begin[1]


def reference_energy(name, mesh, handles, yardstick):
    """The energy of REFERENCE; cached, as it takes minutes."""
    file = shapes.ROOT / "build" / "bench" / f"reference-{name}.npz"
    if not file.exists():
        samples = af.sample_mesh(*mesh, count=REFERENCE_SAMPLES)
        energy, _ = yardstick.energy(af.deform(samples, handles, REFERENCE))
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez(file, energy=energy)
    return float(np.load(file)["energy"])


def row(name, rounds=3):
    mesh, handles = surface(name), handles_of(name)
    yardstick, options = Yardstick(mesh, handles), af.DeformOptions()
    reference = reference_energy(name, mesh, handles, yardstick)
    presses = [Press(mesh, handles, options) for _ in range(rounds)]
    first, first_cpu = np.min([press.first for press in presses], axis=0)
    last, last_cpu = np.min([press.last for press in presses], axis=0)
    few = af.LiveDeformer(af.sample_mesh(*mesh), handles, af.LiveOptions(**FEW)).solve()
    energy, folded = yardstick.energy(presses[0].field)
    first_energy, first_folded = yardstick.energy(few)
    return {
        "what": name if name in shapes.CREATURES else shapes.label(name),
        "vertices": len(mesh[0]),
        "reference_energy": round(reference, 4),
        "first_s": round(first, 3),
        "first_processor_s": round(first_cpu, 3),
        "first_energy_ratio": round(first_energy / reference, 3),
        "last_s": round(last, 2),
        "last_processor_s": round(last_cpu, 2),
        "last_energy_ratio": round(energy / reference, 3),
        "handle_error_percent": round(100 * yardstick.handle_error(presses[0].field), 3),
        "folded": max(folded, first_folded),
        "steps": presses[0].field.report["iterations"],
    }


def names():
    published = [name for name in ("bunny", "spot", "hand", "shiba") if shapes.is_published(name)]
    return published + list(shapes.CREATURES)


def run_defaults():
    return [row(name) for name in names()]
