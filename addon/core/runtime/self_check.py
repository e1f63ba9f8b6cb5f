# SPDX-License-Identifier: GPL-3.0-or-later
"""Self-check: solves small problems with known results on this machine, in seconds."""

import tempfile
import time
from pathlib import Path

import numpy as np

from . import native

CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
SIDES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)
LIFT = np.array([0.0, 0.0, 0.5])
CLOSE = 1e-5  # tolerance of single precision, for lengths around 1
FOLLOWED = 0.05  # tolerance for soft handles
CELL = 0.1  # cell size of the grid on which the cube's surface is extracted


def distances(af):
    points = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 2.0]])
    expect(af.signed_distance(CUBE, SIDES, points), [-1.0, -0.5, 2.0, 2.0**0.5], CLOSE)


def surface(af):
    vertices = af.extract_surface(af.MeshSdf(CUBE, SIDES), 32)[0]
    expect(np.abs(vertices).max(1), np.ones(len(vertices)), CELL)


def network(af):
    """A fit, saved and loaded: tests libtorch, its threads and the file format."""
    sdf = af.fit_sdf(CUBE, SIDES, af.FitOptions(width=16, iterations=20, time_budget=5.0))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cube ü.safetensors"
        sdf.save(path)
        expect(af.NeuralSdf.load(path)(CUBE), sdf(CUBE), CLOSE)


def handles(af):
    """The cube's lower side held, its upper side lifted by half."""
    low, high = np.diag([1.2, 1.2, 0.3, 1.0]), np.diag([1.2, 1.2, 0.3, 1.0])
    low[2, 3], high[2, 3] = -1.0, 1.0
    moved = high.copy()
    moved[2, 3] += 0.5
    return [af.CuboidHandle(low, low), af.CuboidHandle(high, moved)]


def deform(af):
    field = af.deform(af.sample_mesh(CUBE, SIDES, count=500), handles(af))
    lifted = np.where(CUBE[:, 2:] > 0, CUBE + LIFT, CUBE)
    expect(field(CUBE)[:, 2], lifted[:, 2], FOLLOWED)


def deform_by_network(af):
    options = af.DeformOptions(field="neural", width=32, iterations=5)
    field = af.deform(af.sample_mesh(CUBE, SIDES, count=200), handles(af), options)
    expect(np.isfinite(field(CUBE)), True, 0)


def live(af):
    solver = af.LiveDeformer(af.sample_mesh(CUBE, SIDES, count=500), handles(af))
    lifted = np.where(CUBE[:, 2:] > 0, CUBE + LIFT, CUBE)
    expect(solver.solve()(CUBE)[:, 2], lifted[:, 2], 2 * FOLLOWED)  # one pose, in a few steps


def refusal(af):
    """A C++ exception of the library arrives as a Python exception with a message."""
    try:
        af.signed_distance(CUBE, SIDES + 100, CUBE)
    except af.InvalidInput as error:
        if str(error):
            return
    raise AssertionError("bad triangles were not refused")


def cancelling(af):
    task = af.Task()
    task.cancel()
    try:
        af.fit_sdf(CUBE, SIDES, task=task)
    except af.Cancelled:
        return
    raise AssertionError("a cancelled fit went on")


CHECKS = {
    "distances": distances,
    "surface of a cube": surface,
    "fit, saved and loaded": network,
    "deform": deform,
    "deform by a network": deform_by_network,
    "live": live,
    "refused input": refusal,
    "cancelling": cancelling,
}


def expect(result, expected, tolerance):
    worst = np.abs(np.asarray(result, float) - np.asarray(expected, float)).max()
    if not worst <= tolerance:
        raise AssertionError(f"off by {worst:.3g}, allowed is {tolerance:.3g}")


def run(checks=CHECKS):
    """(lines of the report, whether all checks pass)."""
    lines, works = native.report(), native.problem() is None
    if not works:
        return lines, False
    library = native.library()
    for name, check in checks.items():
        begun, problem = time.perf_counter(), ""
        try:
            check(library)
        except Exception as error:  # run the other checks after any error
            problem = f"{type(error).__name__}: {error}"
        seconds = time.perf_counter() - begun
        lines.append(f"{name}: {problem or 'right'} ({seconds:.1f} s)")
        works = works and not problem
    return lines, works
