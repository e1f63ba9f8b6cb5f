# SPDX-License-Identifier: GPL-3.0-or-later
"""Solves against references: exact handles by the least energy, the defaults by first and last results."""

import threading
import time

import numpy as np
from scipy import linalg, optimize

import arapfields as af
from arapfields._native import testing

from . import shapes
from .shapes import cases, inside

# Exact handles: their energy against the least under the same constraints.
#
# The oracle eliminates the constraints: among the fields of a radial basis of many centers, those that meet
# them are c₀ + N z, with N an orthonormal basis of the null space, and L-BFGS finds the z of least energy,
# from a soft solution; products with the basis are in single precision. Two kinds of constraints, at points
# of the surface in the boxes: where they go, and that together with how their surroundings turn, as whole
# boxes that move ask. Half of the oracle's freedom goes into the second kind, so exact handles with many
# more centers are run beside it.

CENTERS = 1200  # centers of the oracle's fine scale
SAMPLES_A_CENTER = 8
FRESH, FRESH_SEED = 20_000, 7
MOST_POINTS = {"places": 300, "boxes": 90}  # per handle
NEGLIGIBLE = 1e-9  # relative to the largest singular value of the constraints
STEPS = 120
FINE = {"centers": 2900, "margin": 0.05}  # settings of exact handles compared with the oracle
FINE_SAMPLES = 40_000
SINGLE = 1e-7  # single precision, relative to the largest curvature
VALUE, FIRST, SECOND = 1, 4, 10  # columns of jets


def energy_of(jets, bending):
    """(mean energy of jets (10, n, 3), its cotangents)."""
    return testing.arap_energy_by_points(np.ascontiguousarray(jets), 1.0, np.ones(len(bending)), bending)


def energy_at(field, points, bending):
    return energy_of(testing.field_jets(field, points, SECOND), bending)[0]


class Oracle:
    """Least energies under constraints, of surface samples whose frame is the identity."""

    def __init__(self, samples, handles, fresh, seed=0):
        self.handles, self.rng = handles, np.random.default_rng(seed)
        options = af.DeformOptions(field="radial", centers=CENTERS, handle_weight=1e4)
        self.soft = af.deform(samples, handles, options)
        size = self.soft.centers + 4
        chosen = self.rng.choice(
            len(samples.points), min(len(samples.points), SAMPLES_A_CENTER * size), False
        )
        self.points = samples.points
        self.bending = testing.bending(samples, options)[chosen]
        self.rows = testing.radial_rows(self.soft, samples.points[chosen], SECOND).astype(np.float32)
        self.fresh, self.fresh_bending = fresh.points, testing.bending(fresh, options)
        # At the soft solution, by its values and derivatives.
        wanted = testing.field_jets(self.soft, samples.points[chosen], SECOND)[:4].reshape(-1, 3)
        known = self.rows[: len(wanted)].astype(float)
        normal = known.T @ known
        normal[np.diag_indices_from(normal)] += 1e-9 * np.diag(normal).mean()
        self.start = linalg.solve(normal, known.T @ wanted, assume_a="pos")

    def constraints(self, kind):
        """Rows (k, size) and their targets (k, 3)."""
        rows, targets = [], []
        for handle in self.handles:
            members = self.points[inside(handle.rest, self.points)]
            taken = self.rng.choice(len(members), min(len(members), MOST_POINTS[kind]), False)
            points, motion = np.ascontiguousarray(members[taken]), handle.motion
            order = VALUE if kind == "places" else FIRST
            rows.append(testing.radial_rows(self.soft, points, order))
            targets.append(points @ motion[:3, :3].T + motion[:3, 3])
            for k in range(order - 1):
                targets.append(np.tile(motion[:3, k], (len(points), 1)))
        return np.concatenate(rows), np.concatenate(targets)

    def least(self, kind):
        """(energy at new samples, largest violation of a constraint)."""
        rows, targets = self.constraints(kind)
        left, values, right = linalg.svd(rows, full_matrices=True)
        rank = int((values > NEGLIGIBLE * values[0]).sum())
        fixed = right[:rank].T @ ((left[:, :rank].T @ targets) / values[:rank, None])
        free = right[rank:].T
        count = len(self.bending)
        basis = (self.rows @ free.astype(np.float32)).reshape(SECOND, count, -1)
        offset = (self.rows.astype(float) @ fixed).reshape(SECOND, count, 3)
        # Preconditioned by the energy's second derivatives at rest.
        scale = np.array([1, 1, 1, 1, 1, 1, 2, 2, 2], np.float32)[:, None] * np.ones(count, np.float32)
        scale[3:] *= self.bending
        weighted = (np.sqrt(scale / count)[..., None] * basis[1:]).reshape(-1, free.shape[1])
        gram = 2 * (weighted.T @ weighted).astype(float)
        curvatures, axes = linalg.eigh(gram)
        roots = np.sqrt(np.maximum(curvatures, SINGLE * curvatures[-1]))
        whitened = axes / roots
        del weighted
        flat = basis[1:].reshape(-1, free.shape[1])

        def loss(y):
            z = whitened @ y.reshape(-1, 3)
            jets = offset.copy()
            jets[1:] += (flat @ z.astype(np.float32)).reshape(SECOND - 1, count, 3)
            energy, cotangents = energy_of(jets, self.bending)
            pulled = flat.T @ cotangents[1:].reshape(-1, 3).astype(np.float32)
            return energy, (whitened.T @ pulled).ravel()

        start = (roots[:, None] * (axes.T @ (free.T @ (self.start - fixed)))).ravel()
        found = optimize.minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": STEPS})
        c = fixed + free @ (whitened @ found.x.reshape(-1, 3))
        total = 0.0
        for part in np.array_split(np.arange(len(self.fresh)), 20):
            jets = testing.radial_rows(self.soft, self.fresh[part], SECOND) @ c
            total += len(part) * energy_of(jets.reshape(SECOND, -1, 3), self.fresh_bending[part])[0]
        return total / len(self.fresh), float(np.abs(rows @ c - targets).max()), found


def random_pair(points, seed):
    """A fixed box around one point of the surface, and a moved and rotated box around another."""
    rng = np.random.default_rng(seed)
    a, b = points[rng.integers(len(points), size=2)]
    while np.abs(a - b).max() < 0.6:
        a, b = points[rng.integers(len(points), size=2)]
    extents = rng.uniform(0.12, 0.25, (2, 3))
    motion = cases.turn(rng.normal(size=3), rng.uniform(20, 50), b)
    motion[:3, 3] += rng.uniform(-0.1, 0.1, 3)
    held, moved = (cases.box(c - e, c + e) for c, e in zip((a, b), extents, strict=True))
    return [cases.moved(held), cases.moved(moved, motion)]


def row(what, draw, handles):
    """`draw(count, seed)` returns samples of the shape."""
    samples, fresh = draw(20_000, 0), draw(FRESH, FRESH_SEED)
    field = af.deform(samples, handles, af.DeformOptions(exact_handles=True))
    bending = testing.bending(fresh, af.DeformOptions())
    exact = energy_at(field, fresh.points, bending)
    fine = af.deform(draw(FINE_SAMPLES, 0), handles, af.DeformOptions(exact_handles=True, **FINE))
    fine = energy_at(fine, fresh.points, bending)
    oracle = Oracle(samples, handles, fresh)
    result = {
        "what": what,
        "energy": round(exact, 5),
        "handle_error": field.report.handle_error_max,
        "fine_energy": round(fine, 5),
        "over_fine": round(exact / fine, 3),
        "soft_energy": round(energy_at(oracle.soft, fresh.points, bending), 5),
    }
    for kind in MOST_POINTS:
        least, violation, found = oracle.least(kind)
        result |= {
            f"least_{kind}": round(least, 5),
            f"over_{kind}": round(exact / least, 3),
            f"violation_{kind}": violation,
            f"steps_{kind}": found.nit,
        }
    return result


def run_exact(pairs=10):
    bunny = shapes.sdf("bunny")

    def of_bunny(count, seed):
        return af.sample_surface(bunny, count=count, seed=seed)

    rows = [row("bar", cases.bar_samples, cases.bar_handles())]
    rows.append(row(shapes.label("bunny"), of_bunny, shapes.handles("bunny", shapes.FULL)))
    points = of_bunny(20_000, 0).points
    return rows + [row(f"random pair {seed}", of_bunny, random_pair(points, seed)) for seed in range(pairs)]


# Deform with its defaults: how soon there is a first result and the last, and how good they are.
#
# Seconds count from the press on: sampling, thickness, centers, solving, moving all vertices. On a shared
# machine the processor's seconds, which two threads divide, say more than the clock's. Energies are means
# over 50,000 fresh samples, divided by the reference's.

VERTICES, FRESH_SAMPLES, SEED_OF_FRESH = 50_000, 50_000, 99
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
        self.fresh = af.sample_mesh(*mesh, count=FRESH_SAMPLES, seed=SEED_OF_FRESH)
        self.bending = testing.bending(self.fresh, af.DeformOptions())
        self.places = np.ascontiguousarray(self.fresh.points)
        self.handles, self.size = handles, np.linalg.norm(np.ptp(mesh[0], axis=0))

    def energy(self, field):
        first, second = field.jacobian(self.places), self.fresh.frame.scale * field.hessian(self.places)
        columns = [first[:, :, 0] * 0, *(first[:, :, k] for k in range(3))]
        columns += [second[:, :, j, k] for j, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        jets = np.ascontiguousarray(np.stack(columns))
        energy, _ = testing.arap_energy_by_points(jets, 1.0, np.ones(FRESH_SAMPLES), self.bending)
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


def row_of_defaults(name, rounds=3):
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
    return [row_of_defaults(name) for name in names()]
