# SPDX-License-Identifier: GPL-3.0-or-later
"""callback=: what it is told, that it changes nothing, how it ends a call, what it may raise."""

import dataclasses

import numpy as np
import pytest
from support.geometry import cases
from support.geometry.meshes import sphere
from support.tolerances import TERMS_OF_LOSS

import arapfields as af

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
def test_each_iteration_is_told_once_with_terms_that_make_its_loss(name):
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
def test_stop_iteration_ends_the_call_with_what_was_reached(name):
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


def test_what_is_no_function_is_refused():
    with pytest.raises(af.InvalidInput, match=r"^callback: .*int"):
        deformed(5)
