# SPDX-License-Identifier: GPL-3.0-or-later
"""Energies of a field: as rigid as possible, preferred normals, handles, stance."""

import numpy as np
import pytest
import torch
from support import tolerances
from support.geometry import cases
from support.oracles import (
    arap_terms,
    gauss_loss,
    gradient_of,
    jacobians_of,
    jets_with_jacobians,
    polar,
    random_rotations,
)
from support.tolerances import FLOAT32_ENERGY, FLOAT64_GRADIENT, FLOAT64_ROTATION, GAUSS_WEIGHTS

import arapfields as af
from arapfields._native import InvalidInput, testing

# Energies of a field: as rigid as possible, preferred normals, handles.

# Stretch and bend: values, cotangents, invariances, and their behaviour where rotations are ambiguous.


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


# Preferred normals, their weights, and the loss that turns surface normals towards them.

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


# Handles: membership, rigid motions, the loss, its cotangents, and errors that name the handle.


def box(center, half, rotation=None):
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if rotation is None else rotation) * np.asarray(half, float)
    matrix[:3, 3] = center
    return matrix


def rigid(rotation, translation):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


@pytest.fixture
def points():
    return np.random.default_rng(0).uniform(-1, 1, size=(2000, 3))


def test_membership_and_targets(points):
    turn = random_rotations(2, np.random.default_rng(1))
    rest = box([0.3, 0.2, -0.1], [0.5, 0.3, 0.6], turn[0])
    motion = rigid(turn[1], [0.1, 0.2, 0.3])
    bound = testing.BoundHandles(
        [
            af.Cuboid(rest, motion @ rest),
            af.Point([0.1, 0.2, 0.3], [4, 4, 4]),
            af.Region([5, 7], rest, motion @ rest),
        ],
        points,
    )
    local = (points - rest[:3, 3]) @ np.linalg.inv(rest[:3, :3]).T
    inside = np.flatnonzero((np.abs(local) <= 1).all(1))
    assert len(inside) > 20
    assert bound.members == [*inside, -1, 5, 7]
    cuboid = slice(0, len(inside))
    assert np.allclose(bound.targets[cuboid], points[inside] @ turn[1].T + [0.1, 0.2, 0.3])
    assert np.allclose(bound.sources[-3], [0.1, 0.2, 0.3]) and np.allclose(bound.targets[-3], [4, 4, 4])
    assert np.allclose(bound.targets[-2:], points[[5, 7]] @ turn[1].T + [0.1, 0.2, 0.3])


def test_loss_is_the_weighted_mean_over_handles(points):
    whole, part = box([0, 0, 0], [2, 2, 2]), box([0, 0, 0], [0.3, 0.3, 0.3])
    handles = [af.Cuboid(whole, rigid(np.eye(3), [0, 0, 1]) @ whole), af.Cuboid(part, part, weight=3.0)]
    bound = testing.BoundHandles(handles, points)
    rng = np.random.default_rng(2)
    values = bound.sources + 0.1 * rng.normal(size=bound.sources.shape)
    distance = np.linalg.norm(values - bound.targets, axis=1)
    n = len(points)
    expected = (np.mean(distance[:n] ** 2) + 3 * np.mean(distance[n:] ** 2)) / 2
    value, cotangents = testing.handle_energy(values[None].copy(), bound, 0.5)
    assert value == pytest.approx(expected, rel=1e-12)
    direction = rng.normal(size=values.shape)
    ends = [testing.handle_energy((values + s * 1e-5 * direction)[None].copy(), bound)[0] for s in (1, -1)]
    assert (ends[0] - ends[1]) / 2e-5 == pytest.approx((cotangents[0] / 0.5 * direction).sum(), rel=1e-8)
    mean, worst = bound.error(values)
    assert mean == pytest.approx((distance[:n].mean() + distance[n:].mean()) / 2)
    assert worst == distance.max()


def test_retarget_moves_the_same_members(points):
    rest = box([0, 0, 0], [0.5, 0.5, 0.5])
    bound = testing.BoundHandles([af.Cuboid(rest, rest), af.Point([0, 0, 0], [0, 0, 0])], points)
    before = bound.sources.copy()
    motion = rigid(random_rotations(1, np.random.default_rng(3))[0], [1, 0, 0])
    bound.retarget([af.Cuboid(rest, motion @ rest), af.Point([0, 0, 0], [0, 1, 0])])
    assert np.array_equal(bound.sources, before)
    assert np.allclose(bound.targets[:-1], before[:-1] @ motion[:3, :3].T + motion[:3, 3])
    assert np.allclose(bound.targets[-1], [0, 1, 0])
    with pytest.raises(af.InvalidInput, match="1 handles"):
        bound.retarget([af.Cuboid(rest, rest)])


def test_slightly_inexact_motions_are_made_rigid():
    rest = box([0.1, 0, 0], [0.5, 0.2, 0.1], random_rotations(1, np.random.default_rng(4))[0])
    noisy = rest.copy()
    noisy[:3, :3] *= 1 + 1e-4
    linear = af.Cuboid(rest, noisy).motion[:3, :3]
    assert np.allclose(linear @ linear.T, np.eye(3), atol=1e-14)


def test_invalid_handles_are_named(points):
    rest = box([0, 0, 0], [0.5, 0.5, 0.5])
    wrong = {
        "scales or shears": rest * [[2], [2], [2], [1]],
        "mirrors": np.diag([-1.0, 1, 1, 1]) @ rest,
        "NaN": np.full((4, 4), np.nan),
        "4×4": np.eye(3),
        "last row": rest + np.eye(4)[3][:, None] * [1, 0, 0, 0],
    }
    for message, target in wrong.items():
        with pytest.raises(af.InvalidInput, match=message):
            af.Cuboid(rest, target)
    with pytest.raises(af.InvalidInput, match="flat"):
        af.Cuboid(box([0, 0, 0], [1, 1, 0]), rest)
    with pytest.raises(af.InvalidInput, match=r"handles\[1\].*no surface sample"):
        far = box([9, 9, 9], [0.5, 0.5, 0.5])
        testing.BoundHandles([af.Cuboid(rest, rest), af.Cuboid(far, far)], points)
    with pytest.raises(af.InvalidInput, match=r"handles\[0\].*sample index 2000"):
        testing.BoundHandles([af.Region([2000], rest, rest)], points)
    with pytest.raises(af.InvalidInput, match="weight"):
        af.Cuboid(rest, rest, weight=-1)


def test_distortion_measures_and_barrier():
    rng = np.random.default_rng(5)
    jacobians = np.eye(3) + 0.6 * rng.normal(size=(300, 3, 3))
    jets = np.zeros((4, 300, 3))
    jets[1:4] = np.moveaxis(jacobians, 2, 0)
    sigma, det = np.linalg.svd(jacobians, compute_uv=False), np.linalg.det(jacobians)
    measured = testing.distortion(jets)
    assert measured.min_determinant == pytest.approx(det.min())
    assert measured.flipped_share == pytest.approx((det <= 0).mean()) and measured.flipped_share > 0
    assert measured.max_stretch == pytest.approx(sigma.max())
    assert measured.min_stretch == pytest.approx(sigma.min(), rel=1e-5)
    value, cotangents = testing.fold_barrier(jets, 0.4)
    assert value == pytest.approx(np.mean(np.maximum(0, 1 - det / 0.4) ** 2))
    direction = rng.normal(size=jets.shape)
    ends = [testing.fold_barrier(jets + s * 1e-6 * direction, 0.4)[0] for s in (1, -1)]
    assert (ends[0] - ends[1]) / 2e-6 == pytest.approx((cotangents * direction).sum(), rel=1e-6)


# What keeps a figure's stance: value and cotangents, what it is blind to, and what it does to a style.

LEAN = 20.0  # energies/stance.h, lean_weight


def figure_on_legs(count=300, seed=0):
    """Points of a cloud that is taller than wide."""
    return np.random.default_rng(seed).normal(size=(count, 3)) * [0.3, 0.2, 0.5]


def oracle(jets, rest, stance):
    """The formula of energies/stance.h, in torch."""
    up, ground, ways = torch.tensor(stance.up), torch.tensor(stance.ground), jets[0] - torch.tensor(rest)
    rises = ways @ up
    uneven = rises - (ground * rises).sum() / ground.sum()
    even = ((ways - ways.mean(0)) ** 2).sum(1).mean()
    return stance.scale * (even + (ground * uneven**2).mean() + leaning(ways, torch.tensor(rest), up))


def leaning(ways, rest, up):
    """LEAN times the squared size and the squared turn about horizontal axes that is closest to the ways."""
    arms = rest - rest.mean(0)
    generators = torch.zeros(3, 3, 3, dtype=arms.dtype)  # [axis]: row vectors a ↦ axis × a
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        generators[axis, i, j], generators[axis, j, i] = 1, -1
    turned = torch.stack([(arms @ generator).reshape(-1) for generator in generators], 1)
    turn = torch.linalg.lstsq(turned, (ways - ways.mean(0)).reshape(-1, 1)).solution[:, 0]
    lean = turn - (turn @ up) * up
    return LEAN * (arms**2).sum(1).mean() * (lean @ lean)


@pytest.mark.parametrize("order", [1, 4, 10])
@pytest.mark.parametrize("up", [[0, 0, 1], [0.3, -2, 0.5]])
def test_value_and_cotangent_equal_autograd_and_differences(order, up):
    rng = np.random.default_rng(1)
    rest = figure_on_legs()
    stance = testing.Stance(rest, up)
    jets = rng.normal(size=(order, len(rest), 3))
    value, cotangents = testing.stance_energy(jets, rest, stance, 0.7)
    expected, gradient = gradient_of(lambda leaf: oracle(leaf, rest, stance), jets)
    assert value == pytest.approx(expected, rel=tolerances.FLOAT64_GRADIENT)
    assert np.abs(cotangents - 0.7 * gradient).max() < tolerances.FLOAT64_GRADIENT * np.abs(gradient).max()
    assert not cotangents[1:].any()
    direction, step = rng.normal(size=jets.shape), 1e-3
    ends = [testing.stance_energy(jets + s * step * direction, rest, stance)[0] for s in (1, -1)]
    slope = (cotangents / 0.7 * direction).sum()
    assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(slope, rel=tolerances.DIFFERENCES)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_the_composition_equals_the_formula(dtype):
    rng = np.random.default_rng(2)
    rest = figure_on_legs().astype(dtype)
    stance = testing.Stance(rest.astype(float), [0.1, 0.2, 1])
    jets = rng.normal(size=(4, len(rest), 3)).astype(dtype)
    kernel = testing.stance_energy(jets, rest, stance, 0.6)
    composed = testing.stance_energy(jets, rest, stance, 0.6, composed=True)
    tolerance = tolerances.COMPOSED if dtype is np.float64 else tolerances.FLOAT32_ENERGY
    assert composed[0] == pytest.approx(kernel[0], rel=tolerance)
    assert np.abs(composed[1] - kernel[1]).max() <= tolerance * np.abs(kernel[1]).max()


def test_translations_are_free_and_units_do_not_matter():
    rest = figure_on_legs()
    moved = rest @ cases.turn([1, 2, 3], 20)[:3, :3].T

    def value(scale, shift):
        stance = testing.Stance(scale * rest, [0, 0, 1])
        return testing.stance_energy(np.ascontiguousarray(scale * moved + shift)[None], scale * rest, stance)[
            0
        ]

    first = value(1.0, 0.0)
    assert first > 0.01
    assert value(1.0, [3.0, -1.0, 2.0]) == pytest.approx(first, rel=1e-12)
    assert value(40.0, 0.0) == pytest.approx(first, rel=1e-12)


def test_the_ground_is_the_lowest_part():
    rest = figure_on_legs()
    for up in ([0, 0, 1], [0, 1, 0], [-1, 0, 0]):
        stance = testing.Stance(rest, up)
        heights = rest @ up
        low = heights < heights.min() + 0.05 * np.ptp(heights)
        assert (stance.ground[low] > 0).all() and not stance.ground[~low].any()
    flat = rest * [1, 1, 0]
    assert (testing.Stance(flat, [0, 0, 1]).ground > 0).all()
    for up in ([0, 0, 0], [np.nan, 0, 1]):
        with pytest.raises(af.InvalidInput, match="up"):
            testing.Stance(rest, up)


def stool(count=2000, seed=0):
    """Samples of an ellipsoidal body on three slanting legs."""
    rng = np.random.default_rng(seed)
    unit = rng.normal(size=(count, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    body, legs = unit[: count // 2], unit[count // 2 :]
    radii = np.array([0.5, 0.35, 0.25])
    points, normals = [body * radii + [0, 0, 0.9]], [body / radii]
    for i, part in enumerate(np.array_split(legs, 3)):
        lean = cases.turn([np.sin(2.1 * i), -np.cos(2.1 * i), 0], 20)[:3, :3]
        foot = np.array([0.09, 0.09, 0.45])
        points.append((part * foot) @ lean.T + [0.4 * np.cos(2.1 * i), 0.3 * np.sin(2.1 * i), 0.42])
        normals.append((part / foot) @ lean.T)
    normals = np.concatenate(normals)
    return af.SurfaceSamples(
        np.concatenate(points),
        normals / np.linalg.norm(normals, axis=1)[:, None],
        frame=af.Frame([0, 0, 0], 1.0),
    )


def way(field, samples):
    """Mean way of the samples other than a translation."""
    ways = field(samples.points) - samples.points
    return np.linalg.norm(ways - ways.mean(0), axis=1).mean()


@pytest.mark.parametrize("field", ["radial", "neural"])
def test_a_style_leaves_the_figure_where_it_stood(field):
    """More of the stance, less of a way; the style is seen nonetheless."""
    samples = stool()
    how = dict(field=field, iterations=60 if field == "radial" else 150, width=48, layers=3)
    free, held = (
        af.stylize(samples, "octahedron", af.StylizeOptions(keep_stance=k, **how)) for k in (0.0, 8.0)
    )
    before = af.gauss_preference(samples.normals, af.preferred_normals("octahedron")).mean()
    assert way(held, samples) < 0.75 * way(free, samples)
    assert held.report["preference"] > before + 0.6 * (free.report["preference"] - before)


def test_live_styles_keep_it_too_and_handles_take_its_place():
    samples = stool()
    ways = {}
    for keep in (0.0, 8.0):
        live = af.LiveDeformer(samples, options=af.LiveOptions(keep_stance=keep, bending=0.1, interior=False))
        live.set_style("octahedron")
        ways[keep] = way(live.solve(iterations=60), samples)
        live.set_style(None)
        live.solve(iterations=200, tolerance=1e-8)
        assert live.report["energy"] < 1e-4
    assert ways[8.0] < 0.75 * ways[0.0]
    top = cases.box([-1, -1, 0.8], [1, 1, 2])
    moved = [
        af.LiveDeformer(samples, [cases.moved(top)], af.LiveOptions(keep_stance=keep)) for keep in (0.0, 8.0)
    ]
    for live in moved:
        live.set_style("cube")
        live.solve(iterations=20)
    assert moved[0].report["value"] == moved[1].report["value"]


def test_up_is_where_the_head_is():
    """The same figure lying on its side, told so, is styled the same."""
    samples = stool()
    turn = cases.turn([1, 0, 0], 90)[:3, :3]
    lying = af.SurfaceSamples(
        samples.points @ turn.T, samples.normals @ turn.T, frame=af.Frame([0, 0, 0], 1.0)
    )
    options = af.StylizeOptions(field="radial", iterations=200)
    first = af.stylize(samples, "square pyramid", options)
    second = af.stylize(lying, "square pyramid", options, orientation=turn, up=turn @ [0, 0, 1])
    for field, s, up in ((first, samples, np.eye(3)[2]), (second, lying, turn[:, 2])):
        lowest = (s.points @ up).argmin()
        assert abs((field(s.points) - s.points)[lowest] @ up) < 1e-9
    assert second.report["preference"] == pytest.approx(first.report["preference"], abs=0.01)
    with pytest.raises(af.InvalidInput, match="up"):
        af.stylize(samples, "cube", options, up=[0, 0, 0])
