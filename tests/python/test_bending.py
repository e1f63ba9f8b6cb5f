# SPDX-License-Identifier: GPL-3.0-or-later
"""The bending weight trades bend for stretch, monotonically."""

import numpy as np
import pytest
from support.geometry import cases

import arapfields as af

WEIGHTS = [0.0, 0.1, 1.0, 10.0]


def check_trade(samples, handles, **options):
    """Stretch rises and bend falls with the weight."""
    fields = [af.deform(samples, handles, af.DeformOptions(bending=w, **options)) for w in WEIGHTS]
    stretch, bend = np.transpose([af.arap_energy(field, samples.points) for field in fields])
    assert (np.diff(bend) < 0).all(), (stretch, bend)
    assert (np.diff(stretch) > 0).all(), (stretch, bend)


def test_on_a_bar_by_bumps():
    check_trade(cases.bar_samples(3000), cases.bar_handles(), field="radial", centers=150)


@pytest.mark.slow
def test_on_a_bar():
    check_trade(cases.bar_samples(6000), cases.bar_handles(), width=128)


@pytest.mark.slow
def test_on_the_published_hand(data_dir):
    samples = cases.published_samples(data_dir / "neural_sdf" / "hand.pt")
    check_trade(samples, cases.hand_handles(), width=128)
