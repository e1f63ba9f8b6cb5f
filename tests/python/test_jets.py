# SPDX-License-Identifier: GPL-3.0-or-later
"""The network's jets and their pull-back against automatic differentiation and finite differences."""

from itertools import pairwise

import numpy as np
import pytest
from support.oracles.network import Network
from support.tolerances import AUTOGRAD, DIFFERENCES, FLOAT_JETS

from arapfields._native import testing

torch = pytest.importorskip("torch")


def random_network(seed, width=24, layers=3, octaves=3, frequency=1.3, sharpness=9.0, outputs=3):
    rng = np.random.default_rng(seed)
    sizes = [6 * octaves, *[width] * layers, outputs]
    weights = [rng.normal(size=(b, a)) / np.sqrt(a) for a, b in pairwise(sizes)]
    biases = [rng.normal(size=b) * 0.3 for b in sizes[1:]]
    return Network(weights, biases, octaves, frequency, sharpness)


def relative(a, b):
    return np.abs(a - b).max() / max(np.abs(b).max(), 1e-30)


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("width,layers,count", [(24, 3, 7), (5, 1, 1), (33, 4, 300)])
def test_jets_and_parameter_gradients_equal_autograd(order, width, layers, count):
    network = random_network(order, width, layers)
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 1, (count, 3))
    expected = network.jets(points, order)
    cotangents = rng.normal(size=expected.shape)
    jets, gradient = testing.mlp_jets(*network.layers, points, order, cotangents.ravel())
    assert relative(jets, expected.detach().numpy()) < AUTOGRAD
    (expected * torch.tensor(cotangents)).sum().backward()
    assert relative(gradient, network.flat_gradient()) < AUTOGRAD


def test_jets_equal_finite_differences():
    network, step = random_network(5), 1e-3
    points = np.random.default_rng(2).uniform(-1, 1, (20, 3))
    jets, _ = testing.mlp_jets(*network.layers, points, 2)

    def slope(k):
        """Central differences of eighth order along axis k of the jets of first order."""
        axis, weights = np.eye(3)[k] * step, [4 / 5, -1 / 5, 4 / 105, -1 / 280]
        ends = [testing.mlp_jets(*network.layers, points + i * axis, 1)[0] for i in range(-4, 5)]
        return sum(w * (ends[4 + i] - ends[4 - i]) for i, w in enumerate(weights, 1)) / step

    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    for k in range(3):
        difference = slope(k)
        assert relative(jets[1 + k], difference[0]) < DIFFERENCES
        for column, (i, j) in enumerate(pairs):
            if k in (i, j):
                other = j if k == i else i
                assert relative(jets[4 + column], difference[1 + other]) < DIFFERENCES


@pytest.mark.parametrize("order", [0, 1, 2])
def test_single_precision_follows_double(order):
    network = random_network(7, width=64, layers=4, sharpness=30.0)
    points = np.random.default_rng(3).uniform(-1, 1, (500, 3)).astype(np.float32)
    expected, _ = testing.mlp_jets(*network.layers, points, order)
    jets, _ = testing.mlp_jets(*network.layers, points, order, None, False)
    for column, reference in zip(jets, expected, strict=True):
        assert relative(column, reference) < FLOAT_JETS
