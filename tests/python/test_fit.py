# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting a network to a mesh's signed distance."""

import threading
import time

import numpy as np
import pytest
from support.geometry.meshes import sphere
from support.tolerances import FIT_REPORT

import arapfields as af

QUICK = {
    "iterations": 60,
    "width": 64,
    "batch": 512,
    "near_points": 20000,
    "uniform_points": 5000,
    "threads": 2,
}


@pytest.fixture(scope="module")
def ball():
    vertices, triangles = sphere(radius=3.0)
    return vertices + np.array([5.0, 0.0, -2.0]), triangles


@pytest.fixture(scope="module")
def fitted(ball):
    return af.fit_sdf(*ball, af.FitOptions(**QUICK))


def test_the_report_tells_the_error_in_mesh_units(ball, fitted):
    report, vertices = fitted.report, ball[0]
    assert report.stopped_by == "iterations" and report.iterations == QUICK["iterations"]
    assert fitted.frame == af.sample_mesh(*ball, count=1).frame and report.scale == fitted.frame.scale
    rng = np.random.default_rng(0)
    spreads = np.where(np.arange(4000) % 2, 0.05, 0.01)[:, None] * fitted.frame.scale
    near = af.sample_mesh(*ball, count=4000, seed=9).points + rng.normal(size=(4000, 3)) * spreads
    error = np.abs(fitted(near) - af.signed_distance(*ball, near))
    assert error.mean() == pytest.approx(report.near_mean, rel=FIT_REPORT)
    anywhere = fitted.frame.to_mesh(rng.uniform(-1, 1, (4000, 3)))
    error = np.abs(fitted(anywhere) - af.signed_distance(*ball, anywhere))
    assert error.mean() == pytest.approx(report.volume_mean, rel=FIT_REPORT)
    assert report.near_mean < 0.01 * np.ptp(vertices) and report.near_mean < report.near_max


def test_the_sign_and_the_gradient_are_right(ball, fitted):
    directions = np.random.default_rng(1).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    centre = ball[0].mean(0)
    assert (fitted(centre + 2.5 * directions) < 0).all() and (fitted(centre + 3.5 * directions) > 0).all()
    slopes = fitted.gradient(centre + 3.0 * directions)
    assert (slopes * directions).sum(1).mean() > 0.9
    assert np.abs(np.linalg.norm(slopes, axis=1) - 1).mean() < 0.1


def test_same_seed_same_network_other_seed_another(ball, fitted):
    points = np.random.default_rng(2).uniform(-1, 1, (100, 3))
    assert np.array_equal(af.fit_sdf(*ball, af.FitOptions(**QUICK))(points), fitted(points))
    assert not np.array_equal(af.fit_sdf(*ball, af.FitOptions(**QUICK, seed=1))(points), fitted(points))


def test_it_stops_at_the_target_or_when_time_is_up(ball):
    quick = {**QUICK, "iterations": 100000}
    stopped = af.fit_sdf(*ball, af.FitOptions(**quick, target_error=0.01)).report
    assert stopped["stopped_by"] == "target_error" and stopped["near_mean"] < 0.012 * stopped["scale"]
    report = af.fit_sdf(*ball, af.FitOptions(**quick, time_budget=0.5)).report
    assert report.stopped_by == "time_budget" and report.seconds > 0.5


def test_adam_learns_too(ball):
    options = af.FitOptions(**QUICK, optimizer="adam", learning_rate=5e-3)
    assert af.fit_sdf(*ball, options).report.near_mean < 0.15


def test_cancel_takes_effect_soon_and_progress_only_rises(ball):
    task, seen, times = af.Task(), [], {}

    def watch():
        while task.progress < 0.15 and len(seen) < 100000:
            seen.append(task.progress)
            time.sleep(0.001)
        seen.append(task.progress)
        times["cancel"] = time.perf_counter()
        task.cancel()

    watcher = threading.Thread(target=watch)
    watcher.start()
    with pytest.raises(af.Cancelled):
        af.fit_sdf(*ball, af.FitOptions(**{**QUICK, "iterations": 2000}), task=task)
    latency = time.perf_counter() - times["cancel"]
    watcher.join()
    assert latency < 2.0  # 0.2 s on an idle machine
    assert seen == sorted(seen) and seen[-1] < 1
    assert "iteration" in task.message


def test_leaving_the_finite_numbers_keeps_the_last_good_state(ball):
    with pytest.raises(af.Diverged, match="learning_rate") as error:
        af.fit_sdf(*ball, af.FitOptions(**QUICK, learning_rate=1e30))
    good = error.value.last_good
    assert np.isfinite(good(ball[0])).all() and good.report.stopped_by == "diverged"


@pytest.mark.parametrize("iterations", [1, 2, 11])
@pytest.mark.parametrize("rate", [1e30, 1e12])
def test_a_last_step_to_infinity_is_a_divergence(ball, rate, iterations):
    options = {**QUICK, "batch": 1, "iterations": iterations, "learning_rate": rate}
    try:
        kept = af.fit_sdf(*ball, af.FitOptions(**options))
    except af.Diverged as error:
        kept = error.last_good
    assert np.isfinite(kept(ball[0])).all()
    assert np.isfinite([kept.report.near_mean, kept.report.near_max, kept.report.volume_max]).all()


def test_a_fit_survives_its_file(fitted, tmp_path):
    fitted.save(tmp_path / "ball.safetensors")
    loaded = af.NeuralSdf.load(tmp_path / "ball.safetensors")
    points = np.random.default_rng(3).uniform(1, 8, (100, 3))
    assert np.array_equal(loaded(points), fitted(points))
    assert loaded.frame == fitted.frame and loaded.report == fitted.report


@pytest.mark.parametrize(
    "wrong,word",
    [
        ({"iterations": 0}, "iterations"),
        ({"batch": 0}, "batch"),
        ({"near_share": 1.5}, "near_share"),
        ({"near_spread": float("nan")}, "near_spread"),
        ({"optimizer": "sgd"}, "muon"),
        ({"device": "tpu"}, "device"),
        ({"width": 0}, "width"),
        ({"threads": -1}, "threads"),
        ({"colour": 1}, "colour"),
    ],
)
def test_wrong_options_are_named(ball, wrong, word):
    with pytest.raises(af.InvalidInput, match=word):
        af.fit_sdf(*ball, af.FitOptions(**wrong))


def test_wrong_meshes_are_named(ball):
    vertices, triangles = ball
    for bad, word in [
        ((vertices[:0], triangles), "vertices"),
        ((vertices, triangles[:0]), "triangles"),
        ((vertices * np.nan, triangles), "vertices"),
        ((vertices, triangles + 1000), "triangles"),
        ((vertices[:, :2], triangles), "vertices"),
    ]:
        with pytest.raises(af.InvalidInput, match=word):
            af.fit_sdf(*bad)
