# SPDX-License-Identifier: GPL-3.0-or-later
"""Reference implementation of the network in PyTorch, double precision, with derivatives by autograd."""

import numpy as np
import torch


class Network:
    def __init__(self, weights, biases, octaves=4, frequency=1.0, sharpness=30.0):
        self.weights = [torch.tensor(np.asarray(w), dtype=torch.float64, requires_grad=True) for w in weights]
        self.biases = [torch.tensor(np.asarray(b), dtype=torch.float64, requires_grad=True) for b in biases]
        self.octaves, self.frequency, self.sharpness = octaves, frequency, sharpness

    @classmethod
    def published(cls, path):
        state = torch.load(path, map_location="cpu")
        names = [f"net.net.{i}" for i in (0, 2, 4, 6, 8)]
        return cls([state[f"{n}.weight"].numpy() for n in names], [state[f"{n}.bias"].numpy() for n in names])

    @property
    def layers(self):
        """Weights, biases, octaves, frequency and sharpness as arguments of the package's functions."""
        arrays = [[t.detach().numpy() for t in group] for group in (self.weights, self.biases)]
        return *arrays, self.octaves, self.frequency, self.sharpness

    def __call__(self, x):
        angles = x.unsqueeze(-1) * (self.frequency * 2.0 ** torch.arange(self.octaves, dtype=x.dtype))
        h = torch.stack([torch.cos(angles), torch.sin(angles)], -1).flatten(-3)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            z = h @ weight.T + bias
            h = torch.logaddexp(z * self.sharpness, torch.zeros_like(z)) / self.sharpness
        return h @ self.weights[-1].T + self.biases[-1]

    def jets(self, points, order):
        return jets_of(self, points, order)

    def flat_gradient(self):
        pairs = zip(self.weights, self.biases, strict=True)
        zero = torch.zeros_like
        return np.concatenate(
            [(zero(t) if t.grad is None else t.grad).numpy().ravel() for pair in pairs for t in pair]
        )


def jets_of(call, points, order=2):
    """(columns, n, outputs): value, ∂_1..3, then ∂_11, ∂_22, ∂_33, ∂_12, ∂_13, ∂_23, by nested autograd."""
    x = torch.tensor(np.asarray(points), dtype=torch.float64, requires_grad=True)
    value = call(x)

    def derivatives(y):
        ones = torch.eye(y.shape[1], dtype=y.dtype)
        rows = [torch.autograd.grad(y, x, e.expand_as(y), create_graph=True)[0] for e in ones]
        return torch.stack(rows, 1).unbind(-1)

    columns = [value]
    if order > 0:
        first = derivatives(value)
        columns += first
    if order > 1:
        second = [derivatives(column) for column in first]
        columns += [second[i][j] for i, j in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]]
    return torch.stack(columns)
