# SPDX-License-Identifier: GPL-3.0-or-later
"""Solves: deformations, styles, contact, skin weights."""

import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

import numpy as np

import arapfields as af

from . import shapes
from .shapes import first_good, once, paired, product_rate

# Deformation: the bend of the bunny to a given quality, and single steps, against iarap's autograd.
#
# Without the published bunny one of our own shapes is bent, to within a share of what many iterations
# reach.

BENDING, HANDLE_WEIGHT = 0.01, 100.0


class Bar(NamedTuple):
    """Thresholds of energy and handle error."""

    energy: float
    handle_error: float

    @classmethod
    def of_shape(cls, samples, handles, iterations=600, slack=1.1):
        if shapes.is_published("bunny"):
            return cls(0.0285, 0.005)
        best = af.deform(samples, handles, af.DeformOptions(iterations=iterations)).report
        return cls(slack * best["energy"], max(0.005, slack * best["handle_error_mean"]))

    def met(self, energy, handle_error):
        return energy <= self.energy and handle_error <= self.handle_error

    def good(self, field):
        return self.met(field.report.energy, field.report.handle_error_mean)

    def __str__(self):
        return f"{shapes.label('bunny')} to E <= {self.energy:.4g}"


def their_network(width=256):
    """The same architecture in PyTorch for autograd, with zero output layer."""
    import torch

    class Network(torch.nn.Module):
        def __init__(self):
            super().__init__()
            sizes = [24, width, width, width, width]
            self.hidden = torch.nn.ModuleList(torch.nn.Linear(a, b) for a, b in itertools.pairwise(sizes))
            self.out = torch.nn.Linear(width, 3)
            torch.nn.init.zeros_(self.out.weight), torch.nn.init.zeros_(self.out.bias)

        def forward(self, x):
            angles = x.unsqueeze(-1) * 2.0 ** torch.arange(4)
            h = torch.stack([torch.cos(angles), torch.sin(angles)], -1).flatten(-3)
            for layer in self.hidden:
                h = torch.nn.functional.softplus(layer(h), beta=30)
            return x + self.out(h)

    torch.manual_seed(0)
    return Network()


def energy_row(samples, count):
    """The energy and its parameter gradient on `count` samples."""
    import iarap
    import torch

    ours = af._native.testing.EnergyTrial(samples, count, BENDING)
    network = their_network()
    torch.nn.init.constant_(network.out.weight, 0.01)
    batch = torch.tensor(samples.points[:count], dtype=torch.float32)

    def theirs():
        network.zero_grad()
        (3 * iarap.arap_energy(network, batch, BENDING / 3).mean()).backward()

    return {
        "what": f"energy and gradient, 4x256, against iarap: N = {count}",
        **paired(ours.run, theirs, rounds=5 if count < 4000 else 3),
    }


class TheirLoop:
    """The same loop with iarap's energy (its stretch is a third of the paper's) and Adam."""

    def __init__(self, samples, handles, count):
        import torch

        self.count = count
        self.network = their_network()
        self.optimizer = torch.optim.Adam(self.network.parameters(), 1e-3)
        self.points = torch.tensor(samples.points, dtype=torch.float32)
        self.pairs = []
        for handle in handles:
            local = (samples.points - handle.rest[:3, 3]) @ np.linalg.inv(handle.rest[:3, :3]).T
            inside = self.points[torch.tensor(np.abs(local).max(1) <= 1)]
            motion = torch.tensor(handle.motion, dtype=torch.float32)
            self.pairs.append((inside, inside @ motion[:3, :3].T + motion[:3, 3]))

    def energy(self, points):
        import iarap

        return iarap.arap_energy(self.network, points, BENDING / 3).mean() * 3

    def step(self):
        import torch

        self.optimizer.zero_grad()
        loss = self.energy(self.points[torch.randint(len(self.points), (self.count,))])
        for source, target in self.pairs:
            pick = torch.randint(len(source), (256,))
            apart = ((self.network(source[pick]) - target[pick]) ** 2).sum(1).mean()
            loss = loss + HANDLE_WEIGHT / len(self.pairs) * apart
        loss.backward()
        self.optimizer.step()

    def quality(self, count=1500):
        """Energy and mean handle error, as in the report of af.deform."""
        import torch

        energy = float(self.energy(self.points[:: max(1, len(self.points) // count)]).detach())
        with torch.no_grad():
            apart = torch.cat([(self.network(a) - b).norm(dim=1) for a, b in self.pairs])
        return energy, float(apart.mean())

    def run_to_quality(self, bar, every=20, most=600):
        """Iterations and seconds until the thresholds are met, without the time of these checks."""
        seconds = 0.0
        iteration = 0
        while iteration < most:
            iteration += every
            seconds += once(lambda: [self.step() for _ in range(every)])
            energy, error = self.quality()
            if bar.met(energy, error):
                break
        return {
            "what": f"{bar}: Adam over iarap, 4x256, N = {self.count}",
            "iterations": iteration,
            "seconds": round(seconds, 2),
            "energy": round(energy, 4),
            "handle_error": round(error, 4),
        }


def run_deform():
    samples, handles = shapes.samples("bunny"), shapes.handles("bunny", shapes.FULL)
    bar = Bar.of_shape(samples, handles)
    rows = []
    settings = {
        "radial": (dict(field="radial"), (8, 16, 32)),
        "neural 4x256": (dict(field="neural"), (40, 60, 80, 120)),
        "neural 4x128": (dict(field="neural", width=128), (40, 60, 80, 120)),
        "neural 4x256, Adam": (dict(field="neural", optimizer="adam"), (80, 120, 160, 240)),
    }
    for name, (options, counts) in settings.items():

        def solve(count, options=options):
            return af.deform(samples, handles, af.DeformOptions(iterations=count, **options))

        count, seconds, report = first_good(solve, bar.good, counts)
        rows.append(
            {
                "what": f"{bar}: {name}",
                "iterations": count,
                "seconds": round(seconds, 2),
                "energy": round(report.energy, 4),
                "handle_error": round(report.handle_error_mean, 4),
            }
        )
    theirs = TheirLoop(samples, handles, 300).run_to_quality(bar)
    for row in rows:
        row["times_faster"] = round(theirs["seconds"] / row["seconds"], 1)
    return [*rows, theirs, *(energy_row(samples, count) for count in (300, 1000, 4000))]


# Gauss stylization of a cow towards a cube: time to a mean preference of 0.95.
#
# `at_175_s` are the seconds scaled to a machine whose bare matrix products run at 175 GFLOP/s.

PREFERENCE = 0.95


def good(field):
    return field.report.preference >= PREFERENCE


def run_stylize():
    samples = shapes.samples("spot")
    settings = {
        "neural 4x256": (dict(field="neural"), (60, 80, 100, 140, 200, 300)),
        "neural 4x128": (dict(field="neural", width=128), (60, 80, 100, 140, 200, 300)),
        "radial": (dict(field="radial"), (10, 20, 40)),
    }
    rows = []
    for name, (options, counts) in settings.items():
        rate = product_rate()

        def solve(count, options=options):
            return af.stylize(samples, "cube", af.StylizeOptions(iterations=count, **options))

        count, seconds, report = first_good(solve, good, counts)
        rate = (rate + product_rate()) / 2
        rows.append(
            {
                "what": f"{shapes.label('spot')} to a mean preference >= {PREFERENCE}: {name}",
                "iterations": count,
                "seconds": round(seconds, 2),
                "products_GFLOPs": round(rate),
                "at_175_s": round(seconds * rate / 175, 2),
                "preference": round(report.preference, 3),
                "flipped": report.flipped_share,
            }
        )
    return rows


# Contact over the family of poses in support/geometry/contact_cases.py, with and without.
#
# Depths and areas in per cent of the size and of the area; handles' errors where nothing holds them back in
# per cent of the size; processor seconds of the default deform. ONLY, a part of a name, chooses cases.


def solve(case, rest, triangles, contact, options=None):
    """(moved vertices, field, processor seconds)"""
    samples = af.sample_mesh(rest, triangles, 20_000, seed=0)
    begin = time.process_time()
    if not case.frames:
        wanted = options or af.DeformOptions()
        result = af.deform(samples, case.handles, wanted, contact=case.contact() if contact else None)
    else:
        live = af.LiveDeformer(samples, case.handles)
        for k in range(case.frames + 1):
            if contact:
                live.set_contact(case.contact(k / case.frames))
            result = live.solve(iterations=20)
    return np.asarray(result(rest)), result, time.process_time() - begin


def errors(case, rest, moved, held):
    """The largest mean error at the vertices inside a handle, of handles that contact does not hold back."""
    found = [0.0]
    ones = np.ones((len(rest), 1))
    for i, handle in enumerate(case.handles):
        inside = (np.abs(np.hstack([rest, ones]) @ np.linalg.inv(handle.rest).T)[:, :3] <= 1).all(1)
        if i not in held and inside.any():
            motion = handle.target @ np.linalg.inv(handle.rest)
            targets = (np.hstack([rest, ones]) @ motion.T)[inside, :3]
            found.append(np.linalg.norm(moved[inside] - targets, axis=1).mean())
    return max(found)


def measure(case):
    from support.geometry import contact_cases as family

    rest, triangles = family.surface(case.shape, str(shapes.data()))
    size = np.ptp(rest, axis=0).max()
    row = {"case": case.name}
    free, _, row["free_s"] = solve(case, rest, triangles, False)
    moved, result, row["contact_s"] = solve(case, rest, triangles, True)
    held = {h.handle for h in result.report.contact.held}
    row["held"] = " ".join(f"{h.handle}:{h.by}:{h.distance / size:.3f}" for h in result.report.contact.held)
    row["error_free"] = 100 * errors(case, rest, free, held) / size
    row["error"] = 100 * errors(case, rest, moved, held) / size
    row["flipped"] = 100 * result.report.flipped_share
    row["ratio"] = row["contact_s"] / row["free_s"]
    if case.solids:
        row["deep_free"] = 100 * family.deepest(case, free) / size
        row["deep"] = 100 * family.deepest(case, moved) / size
    if case.itself:
        for name, reader in (("inside", family.overlapping), ("cut", family.crossing)):
            row[name + "_free"] = 100 * reader(rest, free, triangles)
            row[name] = 100 * reader(rest, moved, triangles)
    return {k: round(v, 4) if isinstance(v, float) else v for k, v in row.items()}, moved


def run_contact():
    from support.geometry import contact_cases as family

    only = os.environ.get("ONLY", "")
    rows = []
    for case in family.family(str(shapes.data())):
        if only in case.name:
            row, moved = measure(case)
            rows.append(row)
            print(row, flush=True)
            if os.environ.get("KEEP"):
                np.save(os.path.join(os.environ["KEEP"], case.name.replace(" ", "_") + ".npy"), moved)
    return rows


# Weights and eight correctives of a child of 50,000 vertices with 25 and 200 bones.

CELLS = 201
COUNTS = (25, 200)


def rig(joints, count):
    """The joints' bones, subdivided evenly to `count`."""
    bones, last = [], {}
    for number, (name, (parent, head, tail)) in enumerate(joints.items()):
        pieces = count // len(joints) + (number < count % len(joints))
        ends = np.linspace(head, tail, pieces + 1)
        for k in range(pieces):
            bones.append(af.Bone(ends[k], ends[k + 1], last.get(parent) if k == 0 else len(bones) - 1))
        last[name] = len(bones) - 1
    return bones


MEASURE = """
import numpy as np, re, sys, time, json, arapfields as af
shape = np.load(sys.argv[1])
vertices, triangles, ends, parents = (shape[name] for name in ("vertices", "triangles", "ends", "parents"))
bones = [af.Bone(*pair, None if p < 0 else int(p)) for pair, p in zip(ends, parents)]
options = af.SkinOptions(correctives=8, threads=2)
begin = time.perf_counter()
weights = af.skin_weights((vertices, triangles), bones, options)
middle = time.perf_counter()
af.skin_correctives(vertices, triangles, bones, weights, options)
print(json.dumps({
    "vertices": len(vertices), "bones": len(bones), "weights_s": round(middle - begin, 1),
    "correctives_s": round(time.perf_counter() - middle, 1),
    "peak_mb": int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1]) // 1024,
}))
"""


def run_skin():
    """A row per number of bones, each measured in a separate process."""
    import bpy  # noqa: F401  (the child's modules are Blender's)
    import people

    body, rows = people.body(cells=CELLS), []
    for count in COUNTS:
        bones = rig(people.JOINTS, count)
        ends = [(bone.head, bone.tail) for bone in bones]
        parents = [-1 if bone.parent is None else bone.parent for bone in bones]
        with tempfile.NamedTemporaryFile(suffix=".npz") as file:
            np.savez(
                file,
                vertices=body.vertices.astype(float),
                triangles=body.triangles,
                ends=ends,
                parents=parents,
            )
            file.flush()
            done = subprocess.run([sys.executable, "-c", MEASURE, file.name], capture_output=True, check=True)
        rows.append(json.loads(done.stdout))
    return rows
