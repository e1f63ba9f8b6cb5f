# SPDX-License-Identifier: GPL-3.0-or-later
"""Every pair of methods of each bound class from two threads: each answer is that of some order of calls."""

import contextlib
import itertools
import random
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from support.programs import pairs

import arapfields as af
from arapfields import _native

SPLATS = ("centers", "rotations", "scales", "opacities", "harmonics")
LONG = 60.0  # seconds a class
OPTIONS = {name for name in dir(_native) if name.endswith("Options")} - {"DeformOptions"}
# What only holds numbers, or is another class's base or kind.
VALUES = {
    "Bone",
    "Contact",
    "Corrective",
    "Obstacle",
    "GaussianSplats",
    "Handle",
    "CuboidHandle",
    "RegionHandle",
    "CurveHandle",
    "CurveReport",
    "CurveSamples",
    "Distortion",
}


def test_each_class_and_method_is_here():
    classes = {
        name
        for name, kind in vars(_native).items()
        if isinstance(kind, type) and not issubclass(kind, Exception) and not name.startswith("_")
    }
    assert classes - OPTIONS - VALUES - {"OutputFile"} == set(pairs.CLASSES)  # OutputFile: below
    for name in pairs.CLASSES:
        kind, calls = getattr(_native, name), pairs.calls_of(name)[1]
        methods = {m for m in dir(kind) if not m.startswith("_") and callable(getattr(kind, m))}
        assert methods - pairs.STATIC - set(calls) == set(), name


@pytest.mark.parametrize("name", pairs.CLASSES)
def test_two_methods_at_once(name):
    make, calls = pairs.calls_of(name)
    for pair in itertools.combinations_with_replacement(calls, 2):
        both = [calls[one] for one in pair]
        if pairs.changes_under_way(name, pair):
            pairs.at_once(make, both)
            continue
        assert pairs.at_once(make, both) in pairs.possible(make, both), pair


@pytest.mark.parametrize("method", ["commit", "finish", "discard"])
def test_an_output_is_finished_once(method, tmp_path):
    """By two threads: it is there, whole, or has been given up; and nothing is left beside it."""
    for number in range(20):
        place = tmp_path / f"{number}.txt"

        def make(place=place):
            place.unlink(missing_ok=True)
            output = _native.OutputFile(place)
            Path(output.partial).write_text("whole")
            return output

        def ended(output):
            getattr(output, method)()

        def committed(output):
            output.commit()

        assert pairs.at_once(make, [committed, ended]) in pairs.possible(make, [committed, ended])
    assert all(path.read_text() == "whole" for path in tmp_path.glob("*.txt"))
    assert not list(tmp_path.glob(".*"))


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers here")
def test_a_signal_handler_that_asks_the_solver_at_work_is_told_so():
    """It runs on the thread that holds the solver, and would wait for itself for ever."""
    ball = np.random.default_rng(0).normal(size=(3000, 3))
    samples = af.SurfaceSamples(ball / np.linalg.norm(ball, axis=1, keepdims=True), ball)
    solver = af.LiveDeformer(
        samples, pairs.pins(), af.LiveOptions(samples=3000, fine_centers=900, interior=False)
    )
    told = []

    def ask(*_):
        try:
            solver.report  # noqa: B018
        except RuntimeError as error:
            told.append(str(error))

    before = signal.signal(signal.SIGALRM, ask)
    signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
    try:
        end = time.monotonic() + 60
        while not told and time.monotonic() < end:
            solver.set_symmetry("x")
            solver.set_symmetry("none")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert told and "at work on this thread" in told[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", pairs.CLASSES)
def test_two_and_three_methods_for_a_minute(name):
    make, calls = pairs.calls_of(name)
    draw, known, end = random.Random(name), {}, time.monotonic() + LONG
    while time.monotonic() < end:
        some = tuple(sorted(draw.choices(list(calls), k=draw.choice((2, 3)))))
        several = [calls[one] for one in some]
        if pairs.changes_under_way(name, some):
            pairs.at_once(make, several)
            continue
        if some not in known:
            known[some] = pairs.possible(make, several)
        assert pairs.at_once(make, several) in known[some], some


def test_nobody_takes_the_memory_of_splats_that_are_written(tmp_path):
    many = af.GaussianSplats(*(np.repeat(getattr(pairs.SPLATS, name), 2000, axis=0) for name in SPLATS))
    prepared, path = af.PreparedSplats(pairs.SPLATS), tmp_path / "kept.ply"
    saving = threading.Thread(target=many.save, args=(path,))
    saving.start()
    with contextlib.suppress(af.InvalidInput):  # "another call is at work on it"
        prepared.moved(pairs.MOVED, into=many)
    saving.join()
    assert len(af.GaussianSplats.load(path)) in (40000, 0)
