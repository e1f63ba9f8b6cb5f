# SPDX-License-Identifier: GPL-3.0-or-later
"""One typed call of each public function, as scripts make them; mypy --strict reads this file too."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import arapfields as af

Array = npt.NDArray[np.float64]

TINY = af.DeformOptions(iterations=3, width=8, layers=1, batch=20)


class Cube(af.ImplicitFunction):
    def __call__(self, points: Array) -> Array:
        distances: Array = np.abs(points).max(axis=1) - 0.5
        return distances


def test_meshes_distances_and_samples() -> None:
    mesh = af.extract_surface(Cube(), 24)
    V, F = mesh
    assert mesh.report.evaluations > 0 and not mesh.report.open
    points: Array = np.zeros((2, 3))
    assert (af.signed_distance(V, F, points, threads=1) < 0).all()
    assert af.winding_number(V, F, points, task=af.Task()) == pytest.approx(1.0, abs=1e-3)
    exact: af.ImplicitFunction = af.MeshSdf(V, F, task=None)
    assert len(af.extract_surface(exact, 16).vertices) > 0 and exact.gradient_bound == 1.0
    samples = af.sample_mesh(V, F, 200, seed=1)
    assert len(samples) == 200 and samples.points.shape == samples.normals.shape
    assert len(af.sample_surface(Cube(), 100, seed=2, threads=1)) == 100
    frame: af.Frame = samples.frame
    assert np.allclose(frame.to_mesh(frame.to_cube(points)), points)


def test_fits_and_files(tmp_path: Path) -> None:
    V, F = af.extract_surface(Cube(), 16)
    options = af.FitOptions(iterations=3, width=8, layers=1, near_points=500, uniform_points=100)
    iterations: list[af.Iteration] = []
    sdf = af.fit_sdf(V, F, options, callback=iterations.append)
    assert len(iterations) == sdf.report.iterations == 3
    sdf.save(tmp_path / "sdf")
    again = af.NeuralSdf.load(str(tmp_path / "sdf"))
    assert again.report == sdf.report
    weights, biases, octaves, frequency, sharpness = sdf.layers
    assert af.NeuralSdf.from_layers(weights, biases, octaves, frequency, sharpness)(V).shape == (len(V),)
    values, origin, spacing = af.sdf_grid(again, 4, bounds=[[-1, -1, -1], [1, 1, 1]])
    af.save_grid(tmp_path / "grid.npz", values, origin, spacing)


class Hold(af.Energy):
    def __call__(self, jets: af.Jets) -> af.EnergyValue:
        off = jets.values - jets.points
        return af.EnergyValue(float((off**2).mean()), 2 * off / off.size)


def held(x: float, shift: float = 0.0) -> af.CuboidHandle:
    rest, target = np.diag([0.2, 1.0, 1.0, 1.0]), np.diag([0.2, 1.0, 1.0, 1.0])
    rest[0, 3], target[0, 3] = x, x + shift
    return af.CuboidHandle(rest, target, weight=1.0)


def test_fields_and_solvers(tmp_path: Path) -> None:
    samples = af.sample_surface(Cube(), 200)
    handles: list[af.Handle] = [held(-0.5), held(0.5, 0.1), af.PointHandle([0, 0, 0.5], (0, 0, 0.6))]
    task: af.Task | None = None
    field = af.deform(samples, handles, TINY, energies=[Hold()], task=task)
    p = samples.points[:10]
    J, D = field.jacobian(p), field.hessian(p)
    assert field(p).shape == (10, 3) and J.shape == (10, 3, 3) and D.shape == (10, 3, 3, 3)
    assert field.inverse(p, tolerance=1e-4, task=task).shape == (10, 3)
    stretch, bend = af.arap_energy(field, p)
    folds: af.Distortion = af.distortion(field, p)
    assert stretch + bend >= 0 and folds.min_stretch <= folds.max_stretch
    field.save(tmp_path / "field")
    report: af.SolveReport = af.DeformationField.load(tmp_path / "field").report
    assert report == field.report
    style = af.StylizeOptions(iterations=3, width=8, layers=1)
    styled = af.stylize(samples, "cube", style, weights=np.ones(200), orientation=np.eye(3))
    assert styled.report.preference is not None
    assert af.gauss_preference(samples.normals, af.preferred_normals("cube"), sharpness=4.0).shape == (200,)
    training = af.InverseTrainingOptions(iterations=2, width=8, layers=1)
    inverse = af.train_inverse(field, samples, training)
    assert 0 < inverse.report.error_mean < 1
    moved = af.extract_deformed(Cube(), field, 16, inverse=inverse, threads=1)
    assert moved.report.inverted > 0


def test_live() -> None:
    samples = af.sample_surface(Cube(), 300)
    live = af.LiveDeformer(samples, [held(-0.5), held(0.5)], af.LiveOptions(fine_centers=20), task=None)
    target = np.eye(4)
    pose: af.RadialField = live.solve([held(-0.5).rest, target @ held(0.5).rest], iterations=3)
    live.track(samples.points)
    assert live.tracked().dtype == np.float32 and pose.centers > 0
    live.set_style("cube", 0.5, sharpness=4.0)
    live.set_handles([held(-0.5)])
    live.reset()
    assert live.report.converged in (True, False) and live.field.report.value >= 0


def test_curves() -> None:
    samples = af.sample_curve([[0, 0], [1, 0], [1, 1], [0, 1]], 40, closed=True)
    handles = [af.CurveHandle([0, 1]), af.CurveHandle(np.arange(20, 22), np.eye(3), weight=2.0)]
    field = af.deform_curve(samples.points, handles, af.CurveOptions(iterations=2))
    assert field.jacobian(samples.points).shape == (40, 2, 2) and field.report.loss >= 0


def test_the_machine() -> None:
    assert af.backend() in ("eigen", "torch")
    assert af.thread_count() >= 1 and af.simd_level() and af.device_report() and "cube" in af.style_names()
