# SPDX-License-Identifier: GPL-3.0-or-later
"""Energies written in Python: what does not fit is named."""

import numpy as np
import pytest
from support.geometry import cases

import arapfields as af


def settings(**changes):
    return dict(width=16, layers=2, iterations=60, batch=100, handle_batch=20) | changes


def n(jets):
    return len(jets.points)


@pytest.mark.parametrize(
    "returned, word",
    [
        (lambda j: 1.0, "float"),
        (lambda j: None, "NoneType"),
        (lambda j: (), "tuple of 0"),
        (lambda j: (np.zeros(3),), "3 numbers"),
        (lambda j: ("x",), "value"),
        (lambda j: (np.nan,), "NaN"),
        (lambda j: (1.0, np.zeros((n(j), 2))), r"values: shape \(\d+, 2\).*\(\d+, 3\)"),
        (lambda j: (1.0, None, np.zeros((n(j), 3))), "jacobians: shape"),
        (lambda j: (1.0, None, None, np.zeros((n(j), 3, 3, 3))), "order is 1"),
        (lambda j: (1.0, np.full((n(j), 3), np.inf)), "derivatives are NaN or infinite"),
    ],
)
def test_what_does_not_fit_is_named(returned, word):
    def good(jets):
        return af.EnergyValue(0.0)

    options = af.DeformOptions(**settings())
    with pytest.raises(af.InvalidInput, match=rf"^energies\[1\].*{word}"):
        af.deform(cases.bar_samples(200), cases.bar_handles(), options, energies=[good, returned])


@pytest.mark.parametrize(
    "wrong, word", [(5, "energies: .*int"), ([5], r"energies\[0\]: .*int"), ([af.Energy], r"energies\[0\]")]
)
def test_what_is_no_energy_is_refused(wrong, word):
    with pytest.raises(af.InvalidInput, match=word):
        af.deform(cases.bar_samples(50), cases.bar_handles(), energies=wrong)


def test_an_order_that_there_is_not_is_refused():
    def mine(jets):
        return af.EnergyValue(0.0)

    mine.order = 3
    with pytest.raises(af.InvalidInput, match=r"energies\[0\]\.order: 3"):
        af.deform(cases.bar_samples(50), cases.bar_handles(), energies=[mine])


def test_an_energy_that_runs_away_is_a_divergence():
    def infinite(jets):
        return (np.inf,)

    with pytest.raises(af.Diverged):
        options = af.DeformOptions(**settings())
        af.deform(cases.bar_samples(50), cases.bar_handles(), options, energies=[infinite])
