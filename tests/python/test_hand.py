# SPDX-License-Identifier: GPL-3.0-or-later
"""The published hand, whose fingers are close in space and far along the surface."""

import numpy as np
import pytest
from support.geometry import cases

import arapfields as af

# Fingers are a quarter of the cube apart: octaves from 4 to 128, whose bending a smaller weight must leave
# room for, at a smaller rate.
THIN_PARTS = dict(frequency=4.0, octaves=6, bending=0.1, bending_unit="cube", learning_rate=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_the_other_fingers_stay(data_dir, seed):
    """The middle finger goes by a third of the hand's length, the other tips by less than 2 % of it."""
    samples = cases.published_samples(data_dir / "neural_sdf" / "hand.pt")
    length = np.ptp(samples.points[:, 2])
    handles = cases.hand_handles()
    assert np.linalg.norm(handles[1].target - handles[1].rest) > 0.3 * length
    options = af.DeformOptions(width=128, iterations=600, seed=seed, **THIN_PARTS)
    field = af.deform(samples, handles, options)
    tips = cases.fingertips(samples)
    tips.pop("middle")
    for name, tip in tips.items():
        assert len(tip) > 50
        moved = np.linalg.norm(field(samples.points[tip]) - samples.points[tip], axis=1)
        assert moved.max() < 0.02 * length, name
    report = field.report
    assert report.handle_error_max < 0.01 * length and report.flipped_share == 0.0
    assert report.energy < 0.005
