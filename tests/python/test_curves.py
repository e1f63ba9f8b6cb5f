# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves of the plane: the energy with d = 2, samples on a curve, and deformations."""

import numpy as np
import pytest
from support.tolerances import DIFFERENCES, FLOAT32_ENERGY, FLOAT64_GRADIENT

import arapfields as af
from arapfields._native import testing


def rotations(angles):
    return np.moveaxis(np.array([[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]]), -1, 0)


def jets_with(jacobians, rng, second=1.0):
    """(6, n, 2) jets with the Jacobians (n, 2, 2), random values and random second derivatives."""
    jets = rng.normal(size=(6, len(jacobians), 2)) * second
    jets[1:3] = np.moveaxis(jacobians, 2, 0)
    return jets


def extruded(jets):
    """The 3-D jets of (x, y, z) → (f(x, y), z)."""
    result = np.zeros((10, jets.shape[1], 3))
    for plane, space in enumerate([0, 1, 2, 4, 5, 7]):
        result[space, :, :2] = jets[plane]
    result[3, :, 2] = 1.0
    return result


def total(jets, bending):
    stretch, bend, _ = testing.arap_energy2(jets, bending)
    return stretch + bending * bend


def bar(length=4.0, height=0.6):
    x, y = length / 2, height / 2
    return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])


def turn(degrees, pivot=(0.0, 0.0), shift=(0.0, 0.0)):
    motion = np.eye(3)
    motion[:2, :2] = rotations(np.radians([degrees]))[0]
    motion[:2, 2] = np.asarray(pivot) - motion[:2, :2] @ pivot + shift
    return motion


@pytest.fixture(scope="module")
def bent_bar():
    points = af.sample_curve(bar(), 400).points
    left, right = np.flatnonzero(points[:, 0] < -1.6), np.flatnonzero(points[:, 0] > 1.6)
    motion = turn(80, (0.5, 0.0))
    handles = [af.CurveHandle(left), af.CurveHandle(right, motion)]
    return points, right, motion, handles, af.deform_curve(points, handles)


def test_rigid_motions_cost_nothing():
    rng = np.random.default_rng(0)
    stretch, bend, cotangents = testing.arap_energy2(
        jets_with(rotations(rng.uniform(-4, 4, 100)), rng, second=0.0), 0.1
    )
    assert stretch < 1e-28 and bend == 0 and np.abs(cotangents).max() < 1e-15


def test_energy_equals_that_of_the_extrusion():
    rng = np.random.default_rng(1)
    jacobians = rotations(rng.uniform(-4, 4, 300)) @ (np.eye(2) + 0.3 * rng.normal(size=(300, 2, 2)))
    jets = jets_with(jacobians[np.linalg.det(jacobians) > 0.05], rng)
    plane, space = testing.arap_energy2(jets, 0.3, 0.7), testing.arap_energy(extruded(jets), 0.3, 0.7)
    assert plane[:2] == pytest.approx(space[:2], rel=FLOAT64_GRADIENT)
    for column, other in enumerate([0, 1, 2, 4, 5, 7]):
        difference = plane[2][column] - space[2][other, :, :2]
        assert np.abs(difference).max() < FLOAT64_GRADIENT * np.abs(plane[2]).max()


def test_cotangents_equal_differences_also_for_reflections():
    """Eighth-order central differences."""
    rng = np.random.default_rng(2)
    jacobians = rng.normal(size=(40, 2, 2))
    sums = np.hypot(
        jacobians[:, 0, 0] + jacobians[:, 1, 1], jacobians[:, 1, 0] - jacobians[:, 0, 1]
    )  # sum of signed singular values
    jets = jets_with(jacobians[sums > 0.7][:12], rng)
    assert (np.linalg.det(np.moveaxis(jets[1:3], 0, 2)) < 0).any()
    cotangents = testing.arap_energy2(jets, 0.1)[2]
    step, weights = 2e-3, {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    for index in np.ndindex(*jets.shape):
        difference = 0.0
        for multiple, weight in weights.items():
            for sign in (1, -1):
                shifted = jets.copy()
                shifted[index] += sign * multiple * step
                difference += sign * weight * total(shifted, 0.1) / step
        assert difference == pytest.approx(cotangents[index], abs=DIFFERENCES * np.abs(cotangents).max())


@pytest.mark.parametrize("jacobian", [np.zeros((2, 2)), np.diag([1.0, -1.0]), np.diag([1e-9, 0.0])])
def test_ambiguous_rotations_stay_finite(jacobian):
    rng = np.random.default_rng(3)
    for dtype in (np.float32, np.float64):
        stretch, bend, cotangents = testing.arap_energy2(
            jets_with(jacobian[None].repeat(5, 0), rng).astype(dtype), 0.1
        )
        assert np.isfinite([stretch, bend]).all() and np.isfinite(cotangents).all()


def test_single_precision_agrees_with_double():
    rng = np.random.default_rng(4)
    jets = jets_with(np.eye(2) + 0.2 * rng.normal(size=(300, 2, 2)), rng)
    double, single = testing.arap_energy2(jets, 0.1), testing.arap_energy2(jets.astype(np.float32), 0.1)
    assert single[:2] == pytest.approx(double[:2], rel=FLOAT32_ENERGY)
    assert np.abs(single[2] - double[2]).max() < FLOAT32_ENERGY * np.abs(double[2]).max()


@pytest.mark.parametrize("reverse", [False, True])
def test_samples_are_spread_evenly_with_outward_normals(reverse):
    angles = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    samples = af.sample_curve(circle[::-1] if reverse else circle, 500)
    steps = np.linalg.norm(np.roll(samples.points, -1, 0) - samples.points, axis=1)
    assert steps == pytest.approx(2 * np.pi / 500, rel=1e-4)
    assert np.sum(samples.normals * samples.points, 1) == pytest.approx(1.0, abs=1e-5)


def test_open_curve_ends_where_it_ends():
    samples = af.sample_curve([[0, 0], [0, 0], [3, 0], [3, 1]], 4, closed=False)
    assert samples.points == pytest.approx(np.array([[0.5, 0], [1.5, 0], [2.5, 0], [3, 0.5]]))
    assert samples.normals == pytest.approx(np.array([[0, -1], [0, -1], [0, -1], [1, 0]]))


def test_rigid_handles_move_the_curve_rigidly():
    points = af.sample_curve(bar(), 300).points
    motion = turn(130, (1.0, 2.0), (3.0, -1.0))
    field = af.deform_curve(points, [af.CurveHandle([3], motion), af.CurveHandle(range(90, 130), motion)])
    expected = points @ motion[:2, :2].T + motion[:2, 2]
    assert np.abs(field(points) - expected).max() < 1e-3
    assert field.report.stretch < 1e-6 and field.report.bend < 1e-5


def test_bar_bends_without_folding(bent_bar):
    points, right, motion, handles, field = bent_bar
    report = field.report
    target = points[right] @ motion[:2, :2].T + motion[:2, 2]
    distance = np.linalg.norm(field(points[right]) - target, axis=1)
    assert distance.max() <= report.handle_error_max * (1 + 1e-9)
    assert report.handle_error_mean < 0.02 and report.min_determinant > 0.3
    assert report.stretch < 0.03
    assert report.converged and report.iterations > 5
    start = af.deform_curve(points, handles, af.CurveOptions(iterations=0)).report
    assert start.iterations == 0 and report.loss < 0.9 * start.loss
    inside = np.random.default_rng(5).uniform(-1, 1, (500, 2)) * [2.0, 0.3]
    assert np.linalg.det(field.jacobian(inside)).min() > 0.05


def test_jacobian_equals_differences(bent_bar):
    points, *_, field = bent_bar
    step = 1e-5
    for k in range(2):
        shift = np.eye(2)[k] * step
        difference = (field(points + shift) - field(points - shift)) / (2 * step)
        assert np.abs(difference - field.jacobian(points)[:, :, k]).max() < 1e-7


def test_result_is_the_same_again_and_in_any_place_and_scale(bent_bar):
    points, _, _, handles, field = bent_bar
    again = af.deform_curve(points, handles)
    assert np.array_equal(again(points), field(points))
    larger, move = 7.0, np.eye(3)
    moved = []
    for handle in handles:
        motion = move @ handle.motion
        motion[:2, 2] = larger * motion[:2, 2] + (np.eye(2) - motion[:2, :2]) @ [100.0, 50.0]
        moved.append(af.CurveHandle(handle.samples, motion))
    other = af.deform_curve(points * larger + [100.0, 50.0], moved)
    assert other.report.stretch == pytest.approx(field.report.stretch, rel=1e-3)
    assert np.abs((other(points * larger + [100, 50]) - [100, 50]) / larger - field(points)).max() < 1e-3


def test_more_bending_weight_gives_less_bend(bent_bar):
    points, _, _, handles, _ = bent_bar
    reports = [
        af.deform_curve(points, handles, af.CurveOptions(bending=weight)).report
        for weight in (1e-3, 1e-2, 1e-1)
    ]
    assert np.all(np.diff([report.bend for report in reports]) < 0)
    assert np.all(np.diff([report.stretch for report in reports]) > 0)


def test_bad_input_is_named():
    points = af.sample_curve(bar(), 50).points
    anchor = af.CurveHandle([0])
    cases = [
        ("vertices", lambda: af.sample_curve([[0, 0], [1, 0]], 10)),
        ("vertices", lambda: af.sample_curve([[1, 1]] * 4, 10)),
        ("vertices", lambda: af.sample_curve([[0, 0], [1, np.nan], [2, 2]], 10)),
        ("count", lambda: af.sample_curve(bar(), 0)),
        ("points", lambda: af.deform_curve(np.zeros((4, 3)), [anchor])),
        ("points", lambda: af.deform_curve(np.ones((4, 2)), [anchor])),
        ("handles", lambda: af.deform_curve(points, [])),
        (r"handles\[1\]", lambda: af.deform_curve(points, [anchor, af.CurveHandle([50])])),
        ("samples", lambda: af.CurveHandle([])),
        ("motion", lambda: af.CurveHandle([1], np.diag([2.0, 1, 1]))),
        ("motion", lambda: af.CurveHandle([1], np.eye(2))),
        ("spacing", lambda: af.deform_curve(points, [anchor], af.CurveOptions(spacing=0.0))),
    ]
    for name, call in cases:
        with pytest.raises(af.InvalidInput, match=name):
            call()


def test_cancel():
    task = af.Task()
    task.cancel()
    points = af.sample_curve(bar(), 50).points
    with pytest.raises(af.Cancelled):
        af.deform_curve(points, [af.CurveHandle([0])], task=task)
