# SPDX-License-Identifier: GPL-3.0-or-later
"""A scan of which the vertices are noisy, as the target of a wrap."""

import numpy as np
from support.geometry import wrap_cases as cases

import arapfields as af

# Vertices of a shape from three quarters of its scan, in % of the diagonal: half again of what a scan without
# noise leaves.
FOUND_IN_NOISE = 0.6


def test_a_shape_is_found_in_a_noisy_scan_of_three_quarters_of_it():
    v, f = cases.figure(5)
    diagonal = np.linalg.norm(np.ptp(v, axis=0))
    kept = f[v[f].mean(1) @ [0.2, 1, -0.5] < 0.35]
    there = np.unique(kept)
    noisy = v + np.random.default_rng(0).normal(0, 0.003 * diagonal, v.shape)
    pairs = [(v[i], noisy[i]) for i in there[np.linspace(0, len(there) - 1, 8, dtype=int)]]
    options = af.WrapOptions(centers=300, stages=3)
    field = af.wrap(af.sample_mesh(v, f, 3000), af.MeshSdf(noisy, kept), pairs, options)
    away = np.linalg.norm(field(v) - v, axis=1)[there].mean() / diagonal
    assert 100 * away < FOUND_IN_NOISE
