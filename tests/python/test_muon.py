# SPDX-License-Identifier: GPL-3.0-or-later
"""Orthogonalised momentum: a step keeps the gradient's singular vectors and evens out its singular values."""

from itertools import pairwise

import numpy as np
import pytest
from support.tolerances import EVENED, SAME_VECTORS

from arapfields._native import testing

RATE = 0.5


def spread_gradient(rng, rows, columns, smallest):
    """A matrix of Frobenius norm 1 with singular values from `smallest` up."""
    rank = min(rows, columns)
    u = np.linalg.qr(rng.normal(size=(rows, rank)))[0]
    v = np.linalg.qr(rng.normal(size=(columns, rank)))[0]
    values = np.geomspace(smallest, 1.0, rank)
    values[:-1] *= 0.9 / max(np.linalg.norm(values[:-1]), 0.9)
    values[-1] = np.sqrt(1 - (values[:-1] ** 2).sum())
    return (u * values) @ v.T, u, v


@pytest.mark.parametrize("width,layers", [(24, 2), (130, 3), (70, 2)])
def test_a_step_evens_out_the_singular_values(width, layers):
    rng = np.random.default_rng(width)
    sizes = [18, *[width] * layers, 3]
    weights = [rng.normal(size=(b, a)) for a, b in pairwise(sizes)]
    biases = [rng.normal(size=b) for b in sizes[1:]]
    gradients = [spread_gradient(rng, b, a, 0.08) for a, b in pairwise(sizes)]
    flat = np.concatenate([np.append(g[0], rng.normal(size=len(g[0]))) for g in gradients])
    after = testing.step_muon(weights, biases, 3, flat, RATE)
    for old, new, (gradient, u, v) in list(zip(weights, after, gradients, strict=True))[:-1]:
        rows, columns = old.shape
        step = (old - new) / (RATE * max(1.0, rows / columns) ** 0.5)
        gram = u.T @ step @ v
        values = np.diag(gram)
        # The step has the gradient's singular vectors alone:
        assert np.abs(gram - np.diag(values)).max() < SAME_VECTORS
        assert np.abs(step - u @ gram @ v.T).max() < SAME_VECTORS
        assert np.abs(values - 1).max() < EVENED
        given = np.linalg.svd(gradient, compute_uv=False)
        assert given[-1] < 0.1 * given[0] and given[-1] > 0.01
