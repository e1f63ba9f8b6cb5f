# SPDX-License-Identifier: GPL-3.0-or-later
"""Radial fields and the live solver on a bar, whose right answers are known."""

import numpy as np
import pytest
from support.geometry.bar import LEFT, RIGHT, bar_samples, box, turned
from support.oracles.energies import random_rotations
from support.tolerances import LIVE_DRIFT, LIVE_IDENTITY, LIVE_ROUNDING, TRACKED

import arapfields as af

QUICK = {"samples": 800, "coarse_centers": 30, "fine_centers": 120}


@pytest.fixture(scope="module")
def samples():
    return bar_samples()


def deformer(surface, /, **options):
    handles = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)]
    return af.LiveDeformer(surface, handles, af.LiveOptions(**(QUICK | options)))


def test_a_rest_pose_is_the_identity_and_costs_nothing(samples):
    live = deformer(samples)
    field = live.solve()
    points = samples.points[:100]
    assert np.abs(field(points) - points).max() < LIVE_IDENTITY
    assert live.report.energy < 1e-15 and live.report.iterations == 0
    live.solve([LEFT, turned(40) @ RIGHT])
    assert np.abs(live.field(points) - points).max() > 0.1
    live.reset()
    assert np.abs(live.field(points) - points).max() < LIVE_IDENTITY
    assert np.abs(live.solve()(points) - points).max() < LIVE_IDENTITY


def test_a_common_rigid_motion_is_reproduced(samples):
    motion = np.eye(4)
    motion[:3, :3] = random_rotations(1, np.random.default_rng(1))[0]
    motion[:3, 3] = [0.5, -1, 2]
    live = deformer(samples)
    field = live.solve([motion @ LEFT, motion @ RIGHT], iterations=200, tolerance=1e-12)
    expected = samples.points @ motion[:3, :3].T + motion[:3, 3]
    assert np.abs(field(samples.points) - expected).max() < 1e-4
    assert live.report.energy < 1e-8


def test_bending_a_bar(samples):
    live = deformer(samples)
    field = live.solve([LEFT, turned(60) @ RIGHT], iterations=100, tolerance=1e-7)
    report = live.report
    assert report.converged and report.flipped_share == 0
    assert report.handle_error_mean < 0.03
    stretch, bend = af.arap_energy(field, samples.points)
    assert report.stretch == pytest.approx(stretch, rel=0.1)  # the solver sees 800 of the 6000 samples
    assert report.bend == pytest.approx(bend, rel=0.2)
    middle = field(np.array([[0.0, 0, 0]]))[0]
    assert abs(middle[1]) < 0.02  # the motion is in the xz plane


def test_steps_never_raise_what_is_minimised(samples):
    live = deformer(samples)
    targets = [LEFT, turned(120, 2, [0, 0.5, 0]) @ RIGHT]
    values = []
    for _ in range(40):
        live.solve(targets, iterations=1, tolerance=1e-9)
        values.append(live.report.value)
    assert (np.diff(values) <= LIVE_ROUNDING * np.array(values[:-1])).all()
    assert values[-1] < 0.5 * values[0]


def test_returning_to_a_pose_returns_its_solution(samples):
    live, fresh = deformer(samples), deformer(samples)
    pose = [LEFT, turned(30) @ RIGHT]
    expected = fresh.solve(pose, iterations=300, tolerance=1e-9)(samples.points[:500])
    rng = np.random.default_rng(2)
    for _ in range(60):
        live.solve([LEFT, turned(rng.normal() * 25, 0) @ turned(rng.normal() * 25, 1) @ RIGHT])
    shape = live.solve(pose, iterations=300, tolerance=1e-9)(samples.points[:500])
    assert np.abs(shape - expected).max() < LIVE_DRIFT * 4  # the bar is 4 long


def test_same_seed_same_bits(samples):
    fields = [deformer(samples).solve([LEFT, turned(30) @ RIGHT]) for _ in range(2)]
    assert np.array_equal(*(field(samples.points[:100]) for field in fields))


def test_field_derivatives_and_files(samples, tmp_path):
    live = deformer(samples)
    field = live.solve([LEFT, turned(50) @ RIGHT])
    points = np.random.default_rng(3).uniform(-1, 1, size=(40, 3)) * [2, 0.6, 0.6]
    step = 4e-5  # rounding of the values, 1e-13, over the step outweighs what the differences leave out
    for k in range(3):
        offset = step * np.eye(3)[k]
        slope = (field(points + offset) - field(points - offset)) / (2 * step)
        assert np.abs(slope - field.jacobian(points)[:, :, k]).max() < 1e-8
        slope = (field.jacobian(points + offset) - field.jacobian(points - offset)) / (2 * step)
        assert np.abs(slope - field.hessian(points)[:, :, :, k]).max() < 1e-7
    field.save(tmp_path / "bar.safetensors")
    again = af.DeformationField.load(tmp_path / "bar.safetensors")
    assert isinstance(again, af.RadialField)
    assert np.array_equal(again(points), field(points))
    assert again.report.energy == field.report.energy
    assert np.nanmax(np.abs(field(field.inverse(field(points))) - field(points))) < 1e-5


def test_handles_come_and_go_and_points_pull(samples):
    live = deformer(samples)
    live.solve([LEFT, turned(30) @ RIGHT])
    bent = live.field(samples.points[:50])
    live.set_handles(
        [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, turned(30) @ RIGHT), af.Point([0, 0, 0.5], [0, 0, 0.5])]
    )
    assert np.array_equal(live.field(samples.points[:50]), bent)
    live.solve([LEFT, turned(30) @ RIGHT, [0, 0, 0.9]], iterations=60)
    assert live.field(np.array([[0, 0, 0.5]]))[0, 2] == pytest.approx(0.9, abs=0.05)
    with pytest.raises(af.InvalidInput, match="one for each of the 3 handles"):
        live.solve([LEFT])
    with pytest.raises(af.InvalidInput, match=r"handles\[1\].*mirrors"):
        live.solve([LEFT, np.diag([-1.0, 1, 1, 1]) @ RIGHT, [0, 0, 1]])
    with pytest.raises(af.InvalidInput, match=r"handles\[0\].*no surface sample"):
        live.set_handles([af.Cuboid(box([9, 9, 9], [1, 1, 1]), box([9, 9, 9], [1, 1, 1]))])
    live.solve(iterations=1)  # and is usable after all that


@pytest.mark.parametrize(
    "handles",
    [
        pytest.param([af.Cuboid(RIGHT, turned(180) @ RIGHT)], id="one handle"),
        pytest.param(
            [af.Cuboid(box([0, 0, 0], [3, 3, 3]), turned(90, 2) @ box([0, 0, 0], [3, 3, 3]))], id="all"
        ),
        pytest.param([af.Point([2, 0, 0], [2, 1, 0])], id="one point"),
        pytest.param([af.Point([x, 0, 0], [x, 0, x]) for x in (-2.0, 0.0, 2.0)], id="collinear points"),
        pytest.param(
            [af.Cuboid(LEFT, turned(180, 0) @ LEFT), af.Cuboid(RIGHT, turned(-180, 0) @ RIGHT)], id="twist"
        ),
        pytest.param([af.Cuboid(RIGHT, RIGHT), af.Cuboid(RIGHT, turned(90) @ RIGHT)], id="contradiction"),
    ],
)
def test_degenerate_handle_sets_give_a_sensible_field(samples, handles):
    live = af.LiveDeformer(samples, handles, af.LiveOptions(**QUICK))
    field = live.solve(iterations=100, tolerance=1e-7)
    moved = field(samples.points)
    assert np.isfinite(moved).all() and np.abs(moved).max() < 10
    assert np.isfinite(live.report.energy)
    if len(handles) == 1:
        assert live.report.energy < 1e-6


def test_flat_and_tiny_sample_sets():
    rng = np.random.default_rng(4)
    flat = np.c_[rng.uniform(-1, 1, size=(500, 2)), np.zeros(500)]
    for points in (flat, flat[:12], np.repeat(flat[:3], 10, axis=0)):
        samples = af.SurfaceSamples(points, np.tile([0.0, 0, 1], (len(points), 1)))
        live = af.LiveDeformer(
            samples, [af.Point(points[0], points[0] + [0, 0, 0.3])], af.LiveOptions(**QUICK)
        )
        assert np.isfinite(live.solve()(points)).all()


def test_many_bumps_stay_well_conditioned(samples):
    live = deformer(samples, coarse_centers=300, fine_centers=1200, samples=2000)
    field = live.solve([LEFT, turned(60) @ RIGHT], iterations=30)
    assert (
        live.report.energy < deformer(samples).solve([LEFT, turned(60) @ RIGHT], iterations=30).report.energy
    )
    assert np.abs(field(samples.points)).max() < 4


def test_style_and_handles_together(samples):
    """A bar asked to turn its faces by 20° about its axis; taking the style away gives the bar back."""
    live = deformer(samples, gauss_weight=2.0, bending=0.1)
    cube = af.preferred_normals("cube") @ turned(20, 0)[:3, :3].T
    before = af.gauss_preference(samples.normals, cube).mean()
    live.set_style(cube)
    live.solve(iterations=40)
    assert live.report.preference > before + 0.1 and live.report.flipped_share == 0
    live.set_style(None)
    live.solve(iterations=60, tolerance=1e-8)
    assert live.report.preference is None and live.report.energy < 1e-4


def test_style_without_handles_holds_the_lowest_sample(samples):
    live = af.LiveDeformer(samples, options=af.LiveOptions(**QUICK, bending=0.1))
    live.set_style(af.preferred_normals("hexagonal prism"), strength=0.5, sharpness=6.0)
    field = live.solve(iterations=30)
    lowest = samples.points[[samples.points[:, 2].argmin()]]
    assert np.abs(field(lowest) - lowest).max() < 0.1
    half = (samples.points[:, 0] < 0).astype(float)
    live.set_style("octahedron", weights=half)
    with pytest.raises(af.InvalidInput, match="one weight"):
        live.set_style("octahedron", weights=half[:5])
    with pytest.raises(af.InvalidInput, match="strength"):
        live.set_style("octahedron", strength=-1)


def test_bad_options_are_named(samples):
    for name, value in [
        ("samples", 0),
        ("fine_centers", 0),
        ("fine_radius_factor", 0.0),
        ("tolerance", -1.0),
        ("iterations", 0),
    ]:
        with pytest.raises(af.InvalidInput, match=name):
            deformer(samples, **{name: value})


def test_tracked_points_are_the_fields(samples):
    live = deformer(samples)
    points = np.random.default_rng(3).permutation(samples.points) + 0.01
    live.track(points)
    assert np.abs(live.tracked() - points).max() < 1e-6
    live.solve([LEFT, turned(50) @ RIGHT])
    assert np.abs(live.tracked() - live.field(points)).max() < TRACKED
    assert live.tracked().dtype == np.float32 and live.tracked().shape == points.shape
    with pytest.raises(af.InvalidInput, match="points"):
        live.track(points[:, :2])
