# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles: membership, rigid motions, the loss, its cotangents, and errors that name the handle."""

import numpy as np
import pytest
from support.oracles.energies import random_rotations

import arapfields as af
from arapfields._native import testing


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
