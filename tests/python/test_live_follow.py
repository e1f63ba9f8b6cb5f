# SPDX-License-Identifier: GPL-3.0-or-later
"""Following a drag: shapes without fields, few steps each, and solves that are cancelled."""

import threading

import numpy as np
import pytest
from support.geometry import cases
from support.geometry.bar import LEFT, RIGHT, bar_samples, turned
from support.tolerances import LIVE_KEEPS_UP, LIVE_WAY_BACK

import arapfields as af


@pytest.fixture(scope="module")
def samples():
    return bar_samples()


def deformer(surface):
    quick = af.LiveOptions(samples=800, coarse_centers=30, fine_centers=120)
    return af.LiveDeformer(surface, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)], quick)


def test_following_is_solving_without_a_field(samples):
    solved, followed = deformer(samples), deformer(samples)
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
    fine, live = deformer(samples), deformer(samples)
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
    live = deformer(samples)
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
