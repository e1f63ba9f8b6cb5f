# SPDX-License-Identifier: GPL-3.0-or-later
"""Live deformation over a radial field."""

import threading
from pathlib import Path

import numpy as np
import pytest
import safetensors
from support.geometry import cases, meshes
from support.geometry.cases import box as box_handle
from support.geometry.cases import moved, published_samples, shift, turn
from support.geometry.meshes import (
    BOTTOM,
    LEFT,
    LEGS,
    RIGHT,
    TIP,
    bar_samples,
    fork_samples,
    handle_box,
    turned,
)
from support.oracles import random_rotations
from support.tolerances import LIVE_DRIFT, LIVE_IDENTITY, LIVE_KEEPS_UP, LIVE_ROUNDING, LIVE_WAY_BACK, TRACKED

import arapfields as af

# Radial fields and the live solver on a bar, whose right answers are known.

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


def test_steps_never_raise_the_energy(samples):
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
        live.set_handles([af.Cuboid(handle_box([9, 9, 9], [1, 1, 1]), handle_box([9, 9, 9], [1, 1, 1]))])
    live.solve(iterations=1)  # and is usable after all that


@pytest.mark.parametrize(
    "handles",
    [
        pytest.param([af.Cuboid(RIGHT, turned(180) @ RIGHT)], id="one handle"),
        pytest.param(
            [af.Cuboid(handle_box([0, 0, 0], [3, 3, 3]), turned(90, 2) @ handle_box([0, 0, 0], [3, 3, 3]))],
            id="all",
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
    live = af.LiveDeformer(samples, handles, af.LiveOptions(**QUICK, locality=0))
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


# Ten thousand motions of a live bar; fingers of a published hand.


def resident_mebibytes():
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc to read memory from")
def test_ten_thousand_motions_leave_no_trace():
    samples = bar_samples()
    options = af.LiveOptions(samples=800, coarse_centers=30, fine_centers=120, threads=1)
    live, fresh = (
        af.LiveDeformer(samples, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)], options) for _ in range(2)
    )
    pose = [LEFT, turned(30) @ RIGHT]
    expected = fresh.solve(pose, iterations=300, tolerance=1e-9)(samples.points[:500])
    rng = np.random.default_rng(0)
    for i in range(10000):
        angles, offset = 25 * rng.normal(size=3), 0.3 * rng.normal(size=3)
        motion = turned(angles[0], 0) @ turned(angles[1], 1) @ turned(angles[2], 2, offset)
        live.solve([LEFT, motion @ RIGHT])
        assert np.isfinite(live.report.value) and np.isfinite(live.report.handle_error_max)
        if i == 1000:
            memory = resident_mebibytes()
    assert resident_mebibytes() < memory + 2
    shape = live.solve(pose, iterations=300, tolerance=1e-9)(samples.points[:500])
    assert np.abs(shape - expected).max() < LIVE_DRIFT * 4  # the bar is 4 long
    live.reset()
    assert np.abs(live.field(samples.points) - samples.points).max() < 1e-8


def test_a_finger_moves_without_its_neighbours(data_dir):
    """The middle finger turned aside by 25 degrees, the palm held: how far the other fingertips go, by the
    hand's length (1.48)."""
    samples = published_samples(data_dir / "neural_sdf" / "hand.pt")
    palm, finger = box_handle([-1, -1, -1], [0.1, 1, 0.03]), box_handle([0, -0.2, 0.62], [0.4, 0.08, 0.9])
    tips = np.array([[0.33, -0.38, 0.1], [0.22, -0.27, 0.56], [0.24, 0.18, 0.62], [0.16, 0.37, 0.35]])
    handles = [moved(palm), moved(finger, turn([1, 0, 0], -25, (-0.1, -0.05, 0.05)))]
    shares, energies = [], []
    for interior in (True, False):
        live = af.LiveDeformer(samples, handles, af.LiveOptions(interior=interior))
        field = live.solve()
        shares.append(np.linalg.norm(field(tips) - tips, axis=1).max() / 1.48)
        energies.append(live.report.energy)
    assert shares[0] < 0.05 < 0.1 < shares[1]
    assert energies[0] < 0.5 * energies[1]


def test_refined_by_a_style_and_handles_at_once():
    """Strength, sharpness and orientation of a style move while a handle does; no set-up is made anew."""
    samples = bar_samples()
    live = af.LiveDeformer(
        samples,
        [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)],
        af.LiveOptions(samples=800, coarse_centers=30, fine_centers=120, bending=0.1, gauss_weight=2.0),
    )
    cube = af.preferred_normals("cube")
    for i in range(1, 6):
        live.set_style(cube @ turned(4.0 * i, 0)[:3, :3].T, strength=0.2 * i, sharpness=4 + 0.4 * i)
        live.solve([LEFT, turned(5.0 * i) @ RIGHT])
        assert live.report.flipped_share == 0 and live.report.handle_error_mean < 0.05
    setup = live.report.setup_seconds
    live.solve(iterations=60)
    assert live.report.setup_seconds == setup
    alone = af.LiveDeformer(samples, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, turned(25) @ RIGHT)])
    plain = alone.solve(iterations=60)
    twisted = af.gauss_preference(samples.normals, cube @ turned(20.0, 0)[:3, :3].T).mean()
    assert live.report.preference > twisted + 0.05
    assert np.abs(live.field(samples.points) - plain(samples.points)).max() > 0.02


# Following a drag: shapes without fields, few steps each, and solves that are cancelled.


def quick_deformer(surface):
    quick = af.LiveOptions(samples=800, coarse_centers=30, fine_centers=120)
    return af.LiveDeformer(surface, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)], quick)


def test_following_is_solving_without_a_field(samples):
    solved, followed = quick_deformer(samples), quick_deformer(samples)
    points = samples.points[:200]
    for live in (solved, followed):
        live.track(points)
    for degrees in (10, 25, 40):
        field = solved.solve([LEFT, turned(degrees) @ RIGHT])
        taken = followed.follow([LEFT, turned(degrees) @ RIGHT])
        assert taken == field.report.iterations > 0
        assert np.array_equal(solved.tracked(), followed.tracked())
    a, b = solved.report.to_dict(), followed.report.to_dict()
    assert {k: v for k, v in a.items() if "seconds" not in k} == {
        k: v for k, v in b.items() if "seconds" not in k
    }
    with pytest.raises(af.InvalidInput, match="iterations"):
        followed.follow(iterations=-1)


def test_three_steps_a_pose_keep_up_with_a_drag(samples):
    """Each begins where the last one ended: they are behind by a part of what one step of it moves."""
    points = samples.points[::40]
    fine, live = quick_deformer(samples), quick_deformer(samples)
    behind, steps, before = [], [], points
    for degrees in range(2, 62, 2):
        pose = [LEFT, turned(degrees) @ RIGHT]
        best = fine.solve(pose, iterations=100, tolerance=1e-6)(points)
        live.follow(pose, iterations=3)
        behind.append(np.abs(live.field(points) - best).max())
        steps.append(np.abs(best - before).max())
        before = best
    assert np.mean(behind) < LIVE_KEEPS_UP * np.mean(steps)


def test_a_solve_goes_on_rightly_after_one_that_was_cancelled(samples):
    """Between two steps the coefficients have moved: what was measured before must not serve again."""
    live = af.LiveDeformer(
        samples, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)], af.LiveOptions(samples=6000)
    )
    live.solve()
    task = af.Task()

    def cancel():
        while task.progress < 2 / 400:
            pass
        task.cancel()

    watcher = threading.Thread(target=cancel)
    watcher.start()
    with pytest.raises(af.Cancelled):
        while True:
            for degrees in (60, -60):
                live.solve([LEFT, turned(degrees) @ RIGHT], iterations=400, tolerance=1e-4, task=task)
    watcher.join()
    field = live.solve([LEFT, turned(40) @ RIGHT], tolerance=1e-4)
    stretch, _ = af.arap_energy(field, samples.points)
    assert field.report.stretch == pytest.approx(stretch, rel=0.05)


def test_a_solve_after_a_cancelled_step_has_no_inertia(samples):
    live = quick_deformer(samples)
    live.set_secondary_motion(af.SecondaryMotionOptions())
    live.step([LEFT, turned(10) @ RIGHT], 1 / 24)
    state, task = live.motion_state, af.Task()
    settled = live.solve([LEFT, RIGHT])(samples.points)
    live.motion_state = state
    timer = threading.Timer(0.05, task.cancel)
    timer.start()
    with pytest.raises(af.Cancelled):
        live.step([LEFT, turned(40) @ RIGHT], 10.0, task=task)
    timer.join()
    assert np.array_equal(live.solve([LEFT, RIGHT])(samples.points), settled)


def test_a_drag_comes_back_as_it_went(data_dir):
    """Measurements that are updated from solve to solve stay those of the coefficients."""
    samples = cases.published_samples(data_dir / "neural_sdf" / "bunny.pt", 3000)
    held, moved = cases.bunny_handles()
    rests = [af.Cuboid(handle.rest, handle.rest) for handle in (held, moved)]
    live, fresh = af.LiveDeformer(samples, rests), af.LiveDeformer(samples, rests)
    for degrees in [*range(0, 70, 2), *range(70, 8, -2)]:
        pose = [held.rest, cases.turn([0, 1, 0], degrees, (-0.1, 0, 0.3)) @ moved.rest]
        live.solve(pose)
        if degrees % 20 == 10:
            fresh.solve(pose, iterations=40)
            assert live.report.value <= LIVE_WAY_BACK * fresh.report.value, degrees


# Live deformation of parts that are near in space but apart along the shape.

# Single precision, of coefficients that nearly cancel between the layers of centers.
SINGLE = 1e-4
# A step of a handle: what it pulls at is never farther from where it goes.
LEFT_BEHIND = 0.02


@pytest.fixture(scope="module")
def fork():
    return fork_samples()


def other_leg_moves(samples, interior):
    """Distance by which the left tip moves when the right one is pulled aside, and the live deformer."""
    handles = [af.Cuboid(BOTTOM, BOTTOM), af.Cuboid(TIP, TIP)]
    live = af.LiveDeformer(samples, handles, af.LiveOptions(interior=interior))
    field = live.solve([BOTTOM, shift([0, 0.4, 0]) @ TIP], iterations=100, tolerance=1e-6)
    assert live.report.handle_error_mean < 0.01
    return np.linalg.norm(field(LEGS[-1]) - LEGS[-1]), live


def test_one_leg_of_a_fork_leaves_the_other_in_place(fork):
    apart, live = other_leg_moves(fork, True)
    together, plain = other_leg_moves(fork, False)
    assert apart < 0.04 * 1.5  # of the fork's length
    assert together > 2 * apart
    assert live.report.energy < plain.report.energy


def test_derivatives_and_files_of_such_a_field(fork, tmp_path):
    _, live = other_leg_moves(fork, True)
    field = live.field
    rng = np.random.default_rng(3)
    points = np.r_[fork.points[:40], rng.uniform(-0.6, 0.6, size=(40, 3)), [[5.0, 5, 5]]]
    step = 2e-6
    for k in range(3):
        offset = step * np.eye(3)[k]
        slope = (field(points + offset) - field(points - offset)) / (2 * step)
        jacobian, hessian = field.jacobian(points), field.hessian(points)
        assert np.abs(slope - jacobian[:, :, k]).max() < 1e-6
        slope = (field.jacobian(points + offset) - field.jacobian(points - offset)) / (2 * step)
        assert np.abs(slope - hessian[:, :, :, k]).max() < 1e-5 * np.abs(hessian).max()
    field.save(tmp_path / "fork.safetensors")
    again = af.DeformationField.load(tmp_path / "fork.safetensors")
    assert np.array_equal(again(points), field(points))
    assert np.array_equal(again.hessian(points), field.hessian(points))
    live.track(points)
    assert np.abs(live.tracked() - field(points)).max() < SINGLE
    live.reset()
    assert np.abs(live.field(points) - points).max() < 1e-8


def test_a_convex_shape_needs_no_lift(fork, tmp_path):
    for surface, embedded in ((bar_samples(), False), (fork, True)):
        live = af.LiveDeformer(surface, [af.Point(surface.points[0], surface.points[0])])
        live.field.save(tmp_path / "field.safetensors")
        with safetensors.safe_open(tmp_path / "field.safetensors", "np") as saved:
            names = list(saved.keys())
        assert any(name.startswith("embedding.") for name in names) == embedded


def test_loose_parts_stay_together():
    """Two balls that do not touch: what nothing joins is joined by the shortest line, and follows."""
    rng = np.random.default_rng(5)
    normals = rng.normal(size=(6000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = 0.5 * normals + np.where(np.arange(6000) < 3000, -0.6, 0.6)[:, None] * [1.0, 0, 0]
    pin = af.Point([-1.1, 0, 0], [-1.1, 0, 0])
    live = af.LiveDeformer(af.SurfaceSamples(points, normals), [pin], af.LiveOptions(locality=0))
    field = live.solve([[-1.1, 0.5, 0]], iterations=100)
    assert np.abs(field(points) - points - [0, 0.5, 0]).max() < 0.05


def test_a_held_speck_beside_a_ball_swings_with_it():
    """Chosen by chance, none of the samples that the handle pulls at would be of it."""
    ball, speck = meshes.sphere(1.0, 4), meshes.box((0.01, 0.01, 0.01))
    v = np.concatenate([ball[0], speck[0] + [0.0, 0.0, 2.0]])
    samples = af.sample_mesh(v, np.concatenate([ball[1], speck[1] + len(ball[0])]), count=6000, seed=2)
    live = af.LiveDeformer(samples, [af.Region(list(range(6000)), np.eye(4), np.eye(4))])
    live.set_secondary_motion(af.SecondaryMotionOptions())
    for step in range(1, 9):
        way = [0.02 * step, 0.0, 0.0]
        moved = live.step([shift(way)], 1 / 24)(v)
        assert np.linalg.norm(moved - v - way, axis=1).max() < LEFT_BEHIND
