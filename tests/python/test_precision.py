# SPDX-License-Identifier: GPL-3.0-or-later
"""Rounded matrix products: a solve that uses them ends where one in single precision does."""

import numpy as np
import pytest
from support import tolerances
from support.geometry import cases

import arapfields as af

SETTINGS = dict(iterations=80, width=96, layers=3, batch=200, threads=1, device="cpu")


@pytest.mark.parametrize("extra", [{}, dict(exact_handles=True)], ids=str)
def test_a_solve_with_rounded_products_is_as_good(extra):
    samples, handles = cases.bar_samples(600), cases.bar_handles(40.0)
    exact, rounded, again = (
        af.deform(samples, handles, af.DeformOptions(precision=precision, **SETTINGS, **extra))
        for precision in ("float32", "bfloat16", "bfloat16")
    )
    places = [field(samples.points) for field in (exact, rounded, again)]
    assert np.abs(places[1] - places[0]).max() > 1e-6  # another arithmetic did run
    assert np.array_equal(places[1], places[2])
    assert rounded.report.energy < exact.report.energy * (1 + tolerances.ROUNDED_SOLVE)
    assert rounded.report.handle_error_mean < exact.report.handle_error_mean + 1e-3


def test_stylize_takes_the_option_too():
    samples = cases.bar_samples(400)
    turned = af.preferred_normals("cube") @ cases.turn([1, 2, 0], 25)[:3, :3]
    exact, rounded = (
        af.stylize(samples, turned, af.StylizeOptions(precision=precision, **SETTINGS)).report
        for precision in ("float32", "bfloat16")
    )
    assert rounded["preference"] == pytest.approx(exact["preference"], abs=0.02)


def test_other_precisions_are_refused():
    with pytest.raises(af.InvalidInput, match=r"precision.*'half'.*bfloat16"):
        af.deform(cases.bar_samples(50), cases.bar_handles(), af.DeformOptions(precision="half"))
