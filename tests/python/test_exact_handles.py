# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact handles of a radial field: interpolated, at little more energy than soft ones."""

from support import tolerances
from support.geometry import cases

import arapfields as af

# A bend's energy with exact handles over that with soft ones, which may miss them.
MOST_OVER_SOFT = 1.2


def test_the_price_of_a_bar():
    samples = cases.bar_samples(3000)
    energies = [
        af.deform(samples, cases.bar_handles(), af.DeformOptions(exact_handles=exact, centers=300)).report
        for exact in (False, True)
    ]
    assert energies[1].handle_error_max < tolerances.EXACT_HANDLE
    assert energies[0].energy < energies[1].energy < MOST_OVER_SOFT * energies[0].energy
    assert energies[1].flipped_share == 0.0


def test_many_centers_stay_in_their_range():
    """Exact handles take more centers than were asked for, but never more than a solver can have."""
    options = af.DeformOptions(exact_handles=True, centers=2300, iterations=1)
    field = af.deform(cases.bar_samples(25_000), cases.bar_handles(), options)
    assert field.report.handle_error_max < tolerances.EXACT_HANDLE
