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
    """On average: after so few iterations one start ends higher, another lower, by a tenth or more."""
    samples, handles = cases.bar_samples(600), cases.bar_handles(40.0)

    def solved(precision, seed):
        options = af.DeformOptions(precision=precision, seed=seed, **SETTINGS, **extra)
        return af.deform(samples, handles, options)

    pairs = [[solved(precision, seed) for precision in ("float32", "bfloat16")] for seed in range(4)]
    (exact, rounded), again = pairs[0], solved("bfloat16", 0)
    places = [field(samples.points) for field in (exact, rounded, again)]
    assert np.abs(places[1] - places[0]).max() > 1e-6  # another arithmetic did run
    assert np.array_equal(places[1], places[2])
    ratios = [rounded.report.energy / exact.report.energy for exact, rounded in pairs]
    assert np.mean(ratios) < 1 + tolerances.ROUNDED_SOLVE
    for exact, rounded in pairs:
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
