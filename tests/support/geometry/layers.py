# SPDX-License-Identifier: GPL-3.0-or-later
"""Small networks without PyTorch, for short processes."""

from itertools import pairwise

import numpy as np


def small_layers(seed=0, width=8, layers=2, octaves=4):
    """(weights, biases) of a small network with random entries."""
    rng = np.random.default_rng(seed)
    sizes = [6 * octaves, *[width] * layers, 1]
    weights = [rng.normal(size=(b, a)) / a**0.5 for a, b in pairwise(sizes)]
    return weights, [rng.normal(size=b) * 0.1 for b in sizes[1:]]
