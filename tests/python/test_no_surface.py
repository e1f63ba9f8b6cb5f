# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions whose zeros are no surface, or a rough one: sentences that are true, and work with a bound."""

import numpy as np
import pytest

import arapfields as af

MOST_VALUES = 2**20 + 2**10 * 500 + 2_000_000  # sample_surface's bound for 500 samples, and one cast of lines
RADIUS = 0.5
QUANTUM = 0.01
ROUGH_NORMALS = np.cos(np.radians(12))  # a step wide enough for QUANTUM is a quarter of the radius


class Counted(af.ImplicitFunction):
    """A function of the distance to a ball, with the points that were asked for."""

    def __init__(self, values):
        super().__init__()
        self.values, self.asked = values, 0

    def __call__(self, points):
        self.asked += len(points)
        return self.values(np.linalg.norm(points, axis=1) - RADIUS, points)


def noise(points):
    """Numbers in [-1, 1] that depend on each bit of the points."""
    bits = np.ascontiguousarray(points).view(np.uint64).reshape(len(points), 3)
    mixed = bits @ np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    return (mixed >> np.uint64(11)) / 2.0**52 - 1.0


def voxels(_, points):
    """±1 in the cells of a grid."""
    centers = (np.floor(points * 16) + 0.5) / 16
    return np.where(np.linalg.norm(centers, axis=1) < RADIUS, -1.0, 1.0)


NO_SURFACES = {
    "zero inside": (lambda d, _: np.maximum(d, 0), "0 on an open set"),
    "zero outside": (lambda d, _: np.minimum(d, 0), "0 on an open set"),
    "a thick zero": (lambda d, _: np.sign(d) * np.maximum(np.abs(d) - 0.1, 0), "0 on an open set"),
    "occupancy 0 and 1": (lambda d, _: np.where(d < 0, 1.0, 0.0), "0 on an open set"),
    "occupancy ±1": (lambda d, _: np.where(d < 0, -1.0, 1.0), "jump from one sign to the other"),
    "voxels ±1": (voxels, "jump from one sign to the other"),
    "noise": (lambda _, points: noise(points), "jump|noise"),
    "noise above 0": (lambda _, points: noise(points) + 1.0, "noise"),
    "a ball in noise": (lambda d, points: d + 0.1 * noise(points), "jump|noise"),
    "too steep": (lambda d, _: 1e20 * d, "too steep"),
    "too flat": (lambda d, _: 1e-9 * d, "changes by less than"),
    "zero": (lambda d, _: 0.0 * d, "changes by less than"),
    "one": (lambda d, _: 0.0 * d + 1.0, "one sign"),
}


@pytest.mark.parametrize("name", NO_SURFACES)
def test_what_is_no_surface_is_told_in_bounded_work(name):
    values, sentence = NO_SURFACES[name]
    function = Counted(values)
    with pytest.raises(af.InvalidInput, match=f"sdf: .*({sentence})"):
        af.sample_surface(function, 500)
    assert function.asked < MOST_VALUES


@pytest.mark.parametrize("name", ["zero inside", "occupancy ±1", "noise", "zero"])
def test_wrap_names_its_target(name):
    samples = af.SurfaceSamples(np.eye(3), np.eye(3))
    with pytest.raises(af.InvalidInput, match=f"target: .*({NO_SURFACES[name][1]})"):
        af.wrap(samples, Counted(NO_SURFACES[name][0]))


@pytest.mark.parametrize(
    "values",
    [
        lambda d, _: QUANTUM * np.round(d / QUANTUM),
        lambda d, points: d + 0.1 * QUANTUM * noise(points),
        lambda d, _: np.where(np.abs(d) < QUANTUM / 2, 0.0, d),
    ],
    ids=["quantised", "noisy", "thin zero"],
)
def test_normals_of_rough_distances(values):
    samples = af.sample_surface(Counted(values), 500)
    outwards = samples.points / np.linalg.norm(samples.points, axis=1, keepdims=True)
    assert np.abs(np.linalg.norm(samples.points, axis=1) - RADIUS).max() < QUANTUM
    assert np.einsum("ij,ij->i", samples.normals, outwards).min() > ROUGH_NORMALS


def test_an_occupancy_has_a_mesh():
    """Of ±1 marching cubes make the cells' middles; the signs are both there."""
    V, F = af.extract_surface(Counted(NO_SURFACES["occupancy ±1"][0]), 32)
    assert len(F) and np.abs(np.linalg.norm(V, axis=1) - RADIUS).max() < 2 / 31
