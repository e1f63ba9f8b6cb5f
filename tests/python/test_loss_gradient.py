# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameter gradients of whole losses, in float64, against differences along random directions."""

import numpy as np
import pytest
from support import tolerances
from support.geometry import cases

import arapfields as af
from arapfields._native import testing

STYLE = af.preferred_normals("cube")
TERMS = {
    "stretch and handles": {},
    "bend": dict(bending=0.05),
    "gauss": dict(bending=0.01, preferred=STYLE, gauss=2.0),
    "barrier": dict(barrier=3.0),
    "stance": dict(keep_stance=2.0),
    "exact handles": dict(bending=0.05, margin=0.4),
    "everything": dict(bending=0.01, preferred=STYLE, gauss=2.0, barrier=3.0, margin=0.4, keep_stance=2.0),
}


@pytest.mark.parametrize("terms", TERMS.values(), ids=TERMS.keys())
def test_gradient_against_differences(terms):
    samples = cases.bar_samples(60)
    probe = testing.LossProbe(samples, cases.bar_handles(30.0), **terms)
    rng = np.random.default_rng(3)
    parameters = rng.normal(size=probe.size) * 0.2
    gradient = probe(parameters, seed=5)[1]
    assert np.abs(gradient).max() > 1e-3
    weights = {1: 672, 2: -168, 3: 32, 4: -3}  # central differences of eighth order, over 840
    step = 5e-3
    for _ in range(4):
        direction = rng.normal(size=probe.size)
        direction /= np.linalg.norm(direction)
        slope = sum(
            weight
            * (
                probe(parameters + k * step * direction, 5)[0]
                - probe(parameters - k * step * direction, 5)[0]
            )
            for k, weight in weights.items()
        ) / (840 * step)
        assert slope == pytest.approx(gradient @ direction, rel=tolerances.LOSS_GRADIENT, abs=1e-8)
