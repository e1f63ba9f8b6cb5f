# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferred normals, their weights, and the loss that turns surface normals towards them."""

import numpy as np
import pytest
import torch
from support.oracles.energies import gauss_loss, gradient_of, jets_with_jacobians
from support.tolerances import FLOAT64_GRADIENT, GAUSS_WEIGHTS

import arapfields as af
from arapfields._native import testing

COUNTS = {
    "cube": 6, "tetrahedron": 4, "octahedron": 8, "dodecahedron": 12, "icosahedron": 20,
    "square prism": 6, "hexagonal prism": 8, "triangular prism": 5,
    "square pyramid": 5, "hexagonal pyramid": 7, "triangular pyramid": 4,
    "cylinder": 34, "cone": 33, "plane pair": 2,
}  # fmt: skip


def test_presets_are_unit_normals_of_the_right_number():
    assert af.style_names() == list(COUNTS)
    for name, count in COUNTS.items():
        normals = af.preferred_normals(name)
        assert normals.shape == (count, 3)
        assert np.allclose(np.linalg.norm(normals, axis=1), 1)
    with pytest.raises(af.InvalidInput, match="known are cube"):
        af.preferred_normals("sphere")


@pytest.mark.parametrize("name", ["dodecahedron", "icosahedron", "octahedron", "tetrahedron", "cube"])
def test_platonic_normals_are_equally_surrounded(name):
    normals = af.preferred_normals(name)
    dots = np.sort(np.round(normals @ normals.T, 9), axis=1)
    assert (dots == dots[0]).all()
    assert np.abs(normals.sum(0)).max() < 1e-12


@pytest.mark.parametrize("sharpness", [2.0, 5.0, 12.0])
@pytest.mark.parametrize("name", list(COUNTS))
def test_preference_is_one_at_preferred_normals(name, sharpness):
    normals = af.preferred_normals(name)
    assert np.abs(af.gauss_preference(normals, normals, sharpness=sharpness) - 1).max() < GAUSS_WEIGHTS


def test_preference_of_many_and_of_close_normals():
    rng = np.random.default_rng(0)
    many = rng.normal(size=(300, 3))
    many /= np.linalg.norm(many, axis=1, keepdims=True)
    close = np.array([[1, 0, 0], [1, 1e-3, 0], [0, 0, 1.0]])
    for preferred in (many, close / np.linalg.norm(close, axis=1, keepdims=True)):
        assert np.abs(af.gauss_preference(preferred, preferred) - 1).max() < GAUSS_WEIGHTS
        everywhere = af.gauss_preference(many, preferred)
        assert everywhere.max() < 1.2 and everywhere.min() > -0.5


def test_bad_preferences_are_named():
    cube = af.preferred_normals("cube")
    cases = [
        ([[1, 0, 0], [0, 1, 0], [2, 0, 0]], "rows 0 and 2"),
        ([[0, 0, 0]], "row 0 is zero"),
        ([[1, np.nan, 0]], "NaN"),
        (np.zeros((0, 3)), "none were given"),
    ]
    for preferred, message in cases:
        with pytest.raises(af.InvalidInput, match=message):
            af.gauss_preference(cube, preferred)
    for sharpness in (-1.0, 101.0, np.nan):
        with pytest.raises(af.InvalidInput, match="sharpness"):
            af.gauss_preference(cube, cube, sharpness=sharpness)


@pytest.mark.parametrize("name", ["cube", "dodecahedron", "cone", "plane pair"])
def test_value_and_cotangent_equal_autograd_and_finite_differences(name):
    rng = np.random.default_rng(1)
    jacobians = rng.normal(size=(400, 3, 3))
    jacobians = jacobians[np.abs(np.linalg.det(jacobians)) > 0.1][:101]
    assert (np.linalg.det(jacobians) < 0).any()
    count = len(jacobians)
    jets = jets_with_jacobians(jacobians, rng, order=4)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    effect = rng.uniform(size=count)
    preferred, weights = testing.gauss_weights(af.preferred_normals(name), 5.0)
    value, cotangents = testing.gauss_energy(jets, normals, preferred, 5.0, 0.7, effect)
    expected, gradient = gradient_of(
        lambda leaf: gauss_loss(
            leaf, *map(torch.tensor, (normals, preferred, weights)), 5.0, torch.tensor(effect)
        ),
        jets,
    )
    assert value == pytest.approx(expected, rel=FLOAT64_GRADIENT)
    assert np.abs(cotangents - 0.7 * gradient).max() < FLOAT64_GRADIENT * np.abs(gradient).max()
    direction = rng.normal(size=jets.shape)
    step = 1e-6
    ends = [
        testing.gauss_energy(jets + sign * step * direction, normals, preferred, 5.0, 1.0, effect)[0]
        for sign in (1, -1)
    ]
    slope = (cotangents / 0.7 * direction).sum()
    assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(slope, rel=1e-7)


def test_collapsed_jacobians_stay_finite_and_single_precision_agrees():
    rng = np.random.default_rng(2)
    normals = rng.normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cube = af.preferred_normals("cube")
    for rank in range(3):
        flat = np.eye(3) * (np.arange(3) < rank)
        jets = jets_with_jacobians(np.tile(flat, (300, 1, 1)), rng, order=4)
        for dtype in (np.float64, np.float32):
            value, cotangents = testing.gauss_energy(jets.astype(dtype), normals, cube, 5.0, 1.0, [])
            assert np.isfinite(value) and np.isfinite(cotangents).all()
    jets = jets_with_jacobians(np.eye(3) + 0.2 * rng.normal(size=(300, 3, 3)), rng, order=4)
    double = testing.gauss_energy(jets, normals, cube, 5.0, 1.0, [])
    single = testing.gauss_energy(jets.astype(np.float32), normals, cube, 5.0, 1.0, [])
    assert single[0] == pytest.approx(double[0], rel=1e-5)
    assert np.abs(single[1] - double[1]).max() < 1e-5
