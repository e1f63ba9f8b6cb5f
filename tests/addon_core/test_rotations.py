# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np

from addon.core.geometry import rotations

EXACT = 1e-9  # float64 arithmetic on numbers near one


def test_the_closest_rotations_are_those_of_the_singular_values():
    """Near rotations, folded ones, flat ones, the zero matrix."""
    rng = np.random.default_rng(5)
    scales = np.array([(1, 1, 1), (1.3, 1, 0.8), (3, 1, 0.1), (1, 1, -0.5), (1, 0.5, 1e-14), (40, 2, 1)])
    left, right = (np.linalg.qr(rng.normal(size=(len(scales), 3, 3)))[0] for _ in range(2))
    left, right = (q * np.sign(np.linalg.det(q))[:, None, None] for q in (left, right))
    found = rotations.closest(np.einsum("nij,nj,njk->nik", left, scales, right))
    assert np.abs(found - left @ right).max() < EXACT
    zero = rotations.closest(np.zeros((1, 3, 3)))[0]
    assert np.abs(zero @ zero.T - np.eye(3)).max() < EXACT and np.linalg.det(zero) > 0
    assert np.isnan(rotations.closest(np.full((1, 3, 3), np.nan))).all()
