# SPDX-License-Identifier: GPL-3.0-or-later
"""Calls under way: cancelled, interrupted, watched, and followed by a callback."""

import dataclasses
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from support.geometry import cases
from support.geometry.meshes import LEFT, RIGHT, bar_samples, sphere, turned
from support.programs.cli import wait_until_loaded
from support.tolerances import TERMS_OF_LOSS

import arapfields as af
from arapfields._interrupts import uninterrupted

# A cancel does not wait for the end of an iteration, however many samples it has.

AT_ONCE = 0.01  # of the time of a solve of one iteration; what takes long before it took 0.05
A_PART = 0.25  # of the shortest iteration seen; a check follows each of its several hundred pieces


def test_a_cancel_does_not_wait_for_the_iteration():
    samples, handles = cases.bar_samples(40_000), cases.bar_handles(40.0)
    options = af.DeformOptions(field="neural", width=64, batch=len(samples.points), iterations=50, threads=1)
    task, moments, ended = af.Task(), [], []

    def solve():
        with pytest.raises(af.Cancelled):
            af.deform(
                samples, handles, options, callback=lambda _: moments.append(time.perf_counter()), task=task
            )
        ended.append(time.perf_counter())

    thread = threading.Thread(target=solve)
    thread.start()
    while len(moments) < 3:
        time.sleep(0.001)
    iteration = min(moments[1] - moments[0], moments[2] - moments[1])
    time.sleep(0.3 * iteration)
    cancelled = time.perf_counter()
    task.cancel()
    thread.join()
    assert ended[0] - cancelled < A_PART * iteration
    assert len(moments) < options.iterations


def seconds(task, **options):
    """Processor time of a solve of one iteration."""
    samples, handles = cases.bar_samples(20_000), cases.bar_handles(40.0)
    before = time.process_time()
    try:
        af.deform(samples, handles, af.DeformOptions(iterations=1, threads=1, **options), task=task)
    except af.Cancelled:
        assert task.cancelled
    return time.process_time() - before


def test_a_task_cancelled_before_the_call_ends_it_at_once():
    task = af.Task()
    task.cancel()
    assert seconds(task) < AT_ONCE * seconds(af.Task())


# Ctrl-C during a native call in the main thread: KeyboardInterrupt, and the library works on.

TESTS = str(Path(__file__).parents[1])
SCRIPT = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.path.insert(0, sys.argv[1])
import arapfields as af
from support.geometry import cases
samples, handles = cases.bar_samples(), cases.bar_handles()
options = dict(width=32, layers=3, batch=100)
print("ready", flush=True)
try:
    af.deform(samples, handles, af.DeformOptions(iterations=10_000_000, **options))
except KeyboardInterrupt:
    print("interrupted", flush=True)
print(af.deform(samples, handles, af.DeformOptions(iterations=3, **options)).report.iterations)
"""


def test_ctrl_c_in_a_script():
    running = subprocess.Popen([sys.executable, "-c", SCRIPT, TESTS], stdout=subprocess.PIPE, text=True)
    try:
        assert running.stdout.readline() == "ready\n"
        time.sleep(0.5)
        running.send_signal(signal.SIGINT)
        printed, _ = running.communicate(timeout=60)
    finally:
        running.kill()
    assert printed.split() == ["interrupted", "3"] and running.returncode == 0


@pytest.mark.parametrize("delay", np.linspace(0.05, 0.4, 6).round(2))
def test_ctrl_c_while_the_library_is_imported_is_no_failed_import(delay):
    """Of Python's end by Ctrl-C, or at its sleep; it was an ImportError in a quarter of tries."""
    script = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    script += "import arapfields, time; time.sleep(60)"
    running = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True)
    try:
        wait_until_loaded(running)
        time.sleep(delay)
        running.send_signal(signal.SIGINT)
        _, said = running.communicate(timeout=60)
    finally:
        running.kill()
    assert said.splitlines()[-1] == "KeyboardInterrupt" and running.returncode != 1, said


def interrupted_after(seconds, call):
    """Sends this process SIGINT while the call runs in the main thread."""
    timer = threading.Timer(seconds, signal.raise_signal, [signal.SIGINT])
    timer.start()
    try:
        call()
    finally:
        timer.join()


def test_ctrl_c_cancels_the_task():
    task = af.Task()
    options = af.DeformOptions(width=32, layers=3, batch=100, iterations=10_000_000)
    with pytest.raises(KeyboardInterrupt):
        interrupted_after(
            0.3, lambda: af.deform(cases.bar_samples(), cases.bar_handles(), options, task=task)
        )
    assert task.cancelled


def test_a_handler_that_raises_nothing_changes_nothing():
    seen = []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(time.monotonic()))
    options = af.DeformOptions(width=32, layers=3, batch=100, iterations=10_000_000, time_budget=1.0)
    try:
        field = None

        def call():
            nonlocal field
            field = af.deform(cases.bar_samples(), cases.bar_handles(), options)

        interrupted_after(0.2, call)
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(seen) == 1 and field.report.out_of_time


def test_a_handler_that_is_not_pythons_stays():
    """Blender without a window handles Ctrl-C itself; Python has None for its handler, and cannot set it."""
    none = mock.patch.object(signal, "getsignal", return_value=None)
    with none, mock.patch.object(signal, "signal") as put, uninterrupted():
        pass
    assert not put.called


# callback=: what it is told, that it changes nothing, how it ends a call, what it may raise.

FIT = dict(iterations=30, width=16, layers=2, batch=128, near_points=2000, uniform_points=500)


def deformed(callback=None, **changes):
    settings = dict(width=16, layers=2, iterations=15, batch=60, handle_batch=20, barrier=0.1) | changes
    samples = cases.bar_samples(400)
    return af.deform(samples, cases.bar_handles(), af.DeformOptions(**settings), callback=callback)


def stylized(callback=None, **changes):
    settings = dict(width=16, layers=2, iterations=15, batch=60) | changes
    samples = af.sample_mesh(*sphere(1.0, 2), 500)
    return af.stylize(samples, "cube", af.StylizeOptions(**settings), callback=callback)


def fitted(callback=None, **changes):
    return af.fit_sdf(*sphere(1.0, 2), af.FitOptions(**FIT | changes), callback=callback)


SURFACE = {"stretch", "bend", "barrier", "handles"}
DEFORM = SURFACE | {"locality"}
CALLS = {
    "fit": (fitted, {}, {"error"}),
    "deform": (deformed, {}, DEFORM),
    "deform_radial": (deformed, {"field": "radial", "barrier": 0.0}, DEFORM - {"barrier"}),
    "deform_invertible": (deformed, {"invertibility": 1.0}, DEFORM | {"invertibility"}),
    "deform_stiff": (deformed, {"bending": 0.0, "barrier": 0.0}, DEFORM - {"bend", "barrier"}),
    "stylize": (stylized, {}, SURFACE | {"style", "stance"}),
    "stylize_radial": (stylized, {"field": "radial", "rigidity": 2.0}, SURFACE | {"style", "stance"}),
}
every_call = pytest.mark.parametrize("name", CALLS)


@every_call
def test_each_iteration_is_reported_once_with_its_terms(name):
    call, changes, terms = CALLS[name]
    calls = []
    report = call(calls.append, **changes).report
    assert [record.iteration for record in calls] == list(range(1, report.iterations + 1))
    for record in calls:
        assert set(record.terms) == terms
        assert sum(record.terms.values()) == pytest.approx(record.loss, rel=TERMS_OF_LOSS)
    assert [r.seconds for r in calls] == sorted(r.seconds for r in calls)
    if hasattr(report, "loss") and "radial" not in name:
        assert [loss for _, loss in report.loss] == pytest.approx([r.loss for r in calls][: len(report.loss)])


@every_call
def test_watching_changes_nothing(name):
    call, changes, _ = CALLS[name]
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    assert np.array_equal(call(lambda _: "ignored", **changes)(points), call(**changes)(points))


@every_call
def test_stop_iteration_returns_the_present_result(name):
    call, changes, _ = CALLS[name]

    def enough(record):
        if record.iteration == 4:
            raise StopIteration

    report = call(enough, **changes).report
    assert report.stopped_by == "callback" and report.iterations == 4
    if name in ("deform", "stylize"):  # rates follow the planned length, so a shorter plan ends elsewhere
        assert len(report.loss) == 4


class Mine(Exception):
    pass


@every_call
def test_anything_else_comes_through_unchanged(name):
    call, changes, _ = CALLS[name]
    error = Mine("in the callback")

    def fails(record):
        if record.iteration == 3:
            raise error

    with pytest.raises(Mine) as caught:
        call(fails, **changes)
    assert caught.value is error


@every_call
def test_a_record_cannot_be_changed(name):
    call, changes, _ = CALLS[name]

    def tries(record):
        with pytest.raises(dataclasses.FrozenInstanceError):
            record.loss = 0.0
        with pytest.raises(TypeError):
            record.terms["stretch"] = 0.0
        raise StopIteration

    call(tries, **changes)


def test_a_callback_may_cancel():
    task = af.Task()
    samples, options = cases.bar_samples(200), af.DeformOptions(width=8, layers=1, iterations=50)
    with pytest.raises(af.Cancelled):
        af.deform(samples, cases.bar_handles(), options, callback=lambda _: task.cancel(), task=task)


def test_a_bad_callback_is_refused():
    with pytest.raises(af.InvalidInput, match=r"^callback: .*int"):
        deformed(5)


# A Task that watches points sees the present shape while a solve runs, and changes nothing of it.

SMALL = {"width": 32, "layers": 2, "batch": 200, "iterations": 60}
HANDLES = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, turned(30) @ RIGHT)]


@pytest.mark.parametrize("field", ["neural", "radial"])
def test_a_watched_solve_shows_the_shape_and_ends_the_same(field):
    samples = bar_samples(2000)
    options = af.DeformOptions(field=field, **SMALL)
    alone = af.deform(samples, HANDLES, options)
    task = af.Task()
    points = samples.points[:50]
    assert task.looks == 0 and task.watched.shape == (0, 3)
    task.watch(points, seconds=0.0)
    watched = af.deform(samples, HANDLES, options, task=task)
    assert np.array_equal(alone(points), watched(points))
    assert task.looks > 0 and task.watched.shape == points.shape
    assert np.abs(task.watched - points).max() > 0.01  # it had begun to move
    if field == "radial":
        assert np.abs(task.watched - watched(points)).max() < 1e-5


@pytest.mark.parametrize("options", [SMALL | {"field": "neural"}, {}])
def test_the_first_shape_is_shown(options):
    """However long is to be waited between two looks."""
    samples, task = bar_samples(2000), af.Task()
    task.watch(samples.points[:50], seconds=1000.0)
    af.deform(samples, HANDLES, af.DeformOptions(**options), task=task)
    assert task.looks == 1


def test_points_that_cannot_be_watched_are_named():
    with pytest.raises(af.InvalidInput, match="points"):
        af.Task().watch(np.full((2, 3), np.nan))
    with pytest.raises(af.InvalidInput, match="seconds"):
        af.Task().watch(np.zeros((2, 3)), seconds=-1.0)
