# SPDX-License-Identifier: GPL-3.0-or-later
"""Reference implementations in PyTorch (float64), with derivatives by autograd: the network, the energies."""

import numpy as np
import torch

# Reference implementation of the network in PyTorch, double precision, with derivatives by autograd.


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


# Reference implementation of the energies in PyTorch (float64), with derivatives by autograd.

# columns of a jet: value, d1 d2 d3, d11 d22 d33 d12 d13 d23
SECOND = [[4, 7, 8], [7, 5, 9], [8, 9, 6]]


def random_rotations(count, rng):
    q = rng.normal(size=(count, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def jets_with_jacobians(jacobians, rng, order=10, second=1.0):
    """(order, n, 3) jets with the Jacobians (n, 3, 3) and random values and second derivatives."""
    jets = rng.normal(size=(order, len(jacobians), 3)) * second
    jets[1:4] = np.moveaxis(jacobians, 2, 0)
    return jets


def jacobians_of(jets):
    """(n, 3, 3) from a NumPy or torch jet: J[p, i, k] = jets[1 + k, p, i]."""
    return torch.as_tensor(jets)[1:4].permute(1, 2, 0)


def polar(jacobians):
    """Closest rotations (det +1) by singular value decomposition."""
    u, _, vh = torch.linalg.svd(jacobians)
    sign = torch.det(u @ vh).detach()
    u = torch.cat([u[..., :2], u[..., 2:] * sign[..., None, None]], -1)
    return u @ vh


def arap_terms(jets):
    """(stretch, bend) means; ∂_k R is the derivative of the polar factor in the direction D_k."""
    jacobians = jacobians_of(jets)
    rotations = polar(jacobians)
    stretch = ((jacobians - rotations) ** 2).sum((1, 2)).mean()
    symmetric = rotations.mT @ jacobians
    bend = 0.0
    for k in range(3):
        slice_k = torch.stack([jets[SECOND[j][k]] for j in range(3)], -1)
        turn = torch.func.jvp(polar, (jacobians,), (slice_k,))[1]
        bend = bend + (turn * (turn @ symmetric)).sum((1, 2)).mean()
    return stretch, bend


def gauss_loss(jets, normals, preferred, weights, sharpness, sample_weights=None):
    moved = torch.linalg.solve(jacobians_of(jets).mT, normals)
    moved = moved / moved.norm(dim=1, keepdim=True)
    g = (torch.exp(sharpness * moved @ preferred.mT) * weights).sum(1)
    return ((1 - g) * (1.0 if sample_weights is None else sample_weights)).mean()


def gradient_of(function, jets):
    """Value(s), and the gradient of the first by the jets."""
    leaf = torch.tensor(jets, requires_grad=True)
    value = function(leaf)
    value.backward()
    return value.item(), leaf.grad.numpy()
