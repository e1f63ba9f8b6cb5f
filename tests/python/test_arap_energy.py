# SPDX-License-Identifier: GPL-3.0-or-later
"""Stretch and bend: values, cotangents, invariances, and their behaviour where rotations are ambiguous."""

import numpy as np
import pytest
import torch
from support.oracles.energies import (
    arap_terms,
    gradient_of,
    jacobians_of,
    jets_with_jacobians,
    polar,
    random_rotations,
)
from support.tolerances import FLOAT32_ENERGY, FLOAT64_GRADIENT, FLOAT64_ROTATION

from arapfields._native import InvalidInput, testing


def signed_jacobians(count, rng):
    """Random Jacobians of both orientations whose rotation is well defined."""
    jacobians = rng.normal(size=(8 * count, 3, 3))
    sigma = np.linalg.svd(jacobians, compute_uv=False)
    sums = sigma[:, 1] + np.sign(np.linalg.det(jacobians)) * sigma[:, 2]
    return jacobians[sums > 0.2][:count]


def test_rotations_equal_those_of_singular_values():
    rng = np.random.default_rng(0)
    jacobians = signed_jacobians(1001, rng)
    block = np.ascontiguousarray(np.moveaxis(jacobians, 2, 0))
    rotations = jacobians_of(np.concatenate([block[:1], testing.closest_rotations(block)]))
    assert (np.linalg.det(jacobians) < 0).mean() > 0.1
    assert np.abs(rotations - polar(torch.tensor(jacobians))).max() < FLOAT64_ROTATION


def test_rotation_of_degenerate_matrices_is_a_best_one():
    """Rank 2, 1, 0, reflections with equal singular values, huge and tiny: tr(RᵀJ) is as large as it gets."""
    rng = np.random.default_rng(1)
    turns = random_rotations(7, rng)
    sigmas = np.array(
        [[1, 1, 0], [1, 0, 0], [0, 0, 0], [1, 1, -1], [2, 1, -1], [1e150, 1e150, 1e149], [1e-150] * 3]
    )
    jacobians = turns @ (sigmas[:, :, None] * random_rotations(7, rng))
    block = np.ascontiguousarray(np.moveaxis(jacobians, 2, 0))
    rotations = jacobians_of(np.concatenate([block[:1], testing.closest_rotations(block)])).numpy()
    assert np.allclose(rotations @ np.swapaxes(rotations, 1, 2), np.eye(3), atol=1e-13)
    assert np.allclose(np.linalg.det(rotations), 1)
    best = sigmas.sum(1)
    assert np.allclose(np.einsum("nij,nij->n", rotations, jacobians), best, rtol=1e-12, atol=1e-12)
    assert np.array_equal(rotations[2], np.eye(3))


@pytest.mark.parametrize("bending", [0.0, 0.01, 1.0])
def test_value_and_cotangent_equal_autograd(bending):
    rng = np.random.default_rng(2)
    jets = jets_with_jacobians(signed_jacobians(301, rng), rng)
    stretch, bend, cotangents = testing.arap_energy(jets, bending, 0.7)
    terms = arap_terms(torch.tensor(jets))
    assert stretch == pytest.approx(terms[0].item(), rel=FLOAT64_GRADIENT)
    assert bend == pytest.approx(terms[1].item(), rel=FLOAT64_GRADIENT)

    def total(leaf):
        s, b = arap_terms(leaf)
        return 0.7 * (s + bending * b)

    expected = gradient_of(total, jets)[1]
    assert np.abs(cotangents - expected).max() <= FLOAT64_GRADIENT * np.abs(expected).max()


def test_cotangent_equals_finite_differences_also_for_reflections():
    rng = np.random.default_rng(3)
    jets = jets_with_jacobians(signed_jacobians(7, rng), rng)
    cotangents = testing.arap_energy(jets, 0.1)[2]

    def total(candidate):
        s, b, _ = testing.arap_energy(candidate, 0.1)
        return s + 0.1 * b

    step = 1e-6
    for index in np.ndindex(*jets.shape):
        shifted = [jets.copy(), jets.copy()]
        shifted[0][index] += step
        shifted[1][index] -= step
        difference = (total(shifted[0]) - total(shifted[1])) / (2 * step)
        assert difference == pytest.approx(cotangents[index], rel=1e-6, abs=1e-6 * np.abs(cotangents).max())


def test_single_precision_agrees_with_double():
    rng = np.random.default_rng(4)
    jets = jets_with_jacobians(np.eye(3) + 0.3 * rng.normal(size=(500, 3, 3)), rng)
    double, single = testing.arap_energy(jets, 0.01), testing.arap_energy(jets.astype(np.float32), 0.01)
    assert single[0] == pytest.approx(double[0], rel=FLOAT32_ENERGY)
    assert single[1] == pytest.approx(double[1], rel=FLOAT32_ENERGY)
    assert np.abs(single[2] - double[2]).max() < FLOAT32_ENERGY * np.abs(double[2]).max()


def test_rigid_motions_cost_nothing_and_composition_changes_nothing():
    rng = np.random.default_rng(5)
    rotations = random_rotations(200, rng)
    stretch, bend, cotangents = testing.arap_energy(jets_with_jacobians(rotations, rng, second=0.0), 0.01)
    assert stretch < 1e-28 and bend == 0 and np.abs(cotangents).max() < 1e-15
    jets = jets_with_jacobians(np.eye(3) + 0.3 * rng.normal(size=(200, 3, 3)), rng)
    turn = random_rotations(1, rng)[0]
    before, after = (
        testing.arap_energy(jets, 0.01),
        testing.arap_energy(np.ascontiguousarray(jets @ turn.T), 0.01),
    )
    assert after[:2] == pytest.approx(before[:2], rel=1e-12)
    assert np.abs(after[2] - before[2] @ turn.T).max() < 1e-12


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize(
    "sigma", [[1, 1, -1], [1, 0, 0], [0, 0, 0], [1, 1, 0], [0.5, 0.5, -0.5], [3, 1e-9, -1e-9]]
)
def test_ambiguous_rotations_stay_finite(sigma, dtype):
    rng = np.random.default_rng(6)
    turns, others = random_rotations(50, rng), random_rotations(50, rng)
    jets = jets_with_jacobians(turns @ (np.array(sigma, float)[:, None] * others), rng).astype(dtype)
    stretch, bend, cotangents = testing.arap_energy(jets, 0.01)
    assert np.isfinite([stretch, bend]).all() and np.isfinite(cotangents).all()
    assert stretch == pytest.approx(((np.array(sigma) - 1) ** 2).sum(), rel=1e-5)
    assert np.abs(cotangents).max() < 1e6


def test_value_equals_the_authors_package():
    iarap = pytest.importorskip("iarap")
    torch.manual_seed(0)
    network = torch.nn.Sequential(torch.nn.Linear(3, 20), torch.nn.Tanh(), torch.nn.Linear(20, 3)).double()

    def field(x):
        return x + 0.5 * network(x)

    x = torch.rand(100, 3, dtype=torch.float64)
    jacobians = torch.func.vmap(torch.func.jacrev(field))(x)
    hessians = torch.func.vmap(torch.func.jacfwd(torch.func.jacrev(field)))(x)
    jets = np.zeros((10, 100, 3))
    jets[1:4] = jacobians.detach().permute(2, 0, 1)
    for column, (j, k) in zip(range(4, 10), [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)], strict=True):
        jets[column] = hessians[:, :, j, k].detach()
    stretch, bend, _ = testing.arap_energy(jets, 0.0)
    theirs = [iarap.arap_energy(field, x, bending).item() for bending in (0.0, 0.01)]
    assert stretch / 3 == pytest.approx(theirs[0], rel=1e-5)  # the package averages the three singular values
    assert stretch / 3 + 0.01 * bend == pytest.approx(theirs[1], rel=1e-5)


def test_bad_jets_are_named():
    with pytest.raises(InvalidInput, match="second ones"):
        testing.arap_energy(np.zeros((4, 5, 3)), 0.01)
    with pytest.raises(InvalidInput, match="first derivatives"):
        testing.arap_energy(np.zeros((1, 5, 3)), 0.0)
    assert testing.arap_energy(np.zeros((10, 0, 3)), 0.01)[:2] == (0, 0)
