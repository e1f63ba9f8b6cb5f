# SPDX-License-Identifier: GPL-3.0-or-later
"""Stiffness in the shape's own measure: the local thickness, and λ that follows it."""

import numpy as np
import pytest
from support.geometry import cases, meshes

import arapfields as af
from arapfields._native import testing

REACH = 0.345  # λ = (REACH t)²
# Radii are those of balls between 1,500 nodes and 6,000 witnesses, evened out over neighbours.
SAMPLED = 0.12


def samples_of(vertices, triangles, count=12000):
    return af.sample_mesh(np.asarray(vertices, float), triangles, count=count)


def test_a_tube_is_as_thick_as_its_radius():
    v, f = meshes.torus()
    samples = samples_of(v, f)
    ring = np.hypot(samples.points[:, 0], samples.points[:, 1])
    middle = 0.5 * (ring.max() + ring.min())
    tube = np.hypot(ring - middle, samples.points[:, 2]).mean()
    assert np.allclose(testing.thickness(samples), tube, rtol=SAMPLED)


@pytest.mark.parametrize("share", [0.05, 0.02])
def test_a_plate_is_half_as_thick_as_its_sides_are_apart(share):
    """Also one that is thinner than samples are apart."""
    v, f = meshes.box((1.0, 1.0, share))
    thickness = testing.thickness(samples_of(v, f))
    assert np.abs(np.median(thickness) / share - 1) < SAMPLED


def test_an_open_sheet_is_as_thick_as_leather_of_its_size():
    """Nothing bounds a ball below it: 0.03 of the square root of its area."""
    v, f = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    thickness = testing.thickness(samples_of(v, f))
    assert np.allclose(thickness, 0.03 * 2.0, rtol=1e-9)


def test_parts_have_their_own_thickness():
    """A ball with a thin square rod: each is as thick as if it were alone, the rod less at its edges."""
    v, f = meshes.sphere()
    rod, g = meshes.box((2.0, 0.1, 0.1))
    both = np.concatenate([v, rod + np.array([2.9, 0, 0])])
    samples = samples_of(both, np.concatenate([f, g + len(v)]), 20000)
    thickness = testing.thickness(samples)
    out = samples.points[:, 0] > 1.6
    assert 0.07 < np.median(thickness[out]) < 0.1 * (1 + SAMPLED)
    assert np.median(thickness[samples.points[:, 0] < 0.5]) > 0.5


def test_bending_is_the_square_of_thickness_in_the_cube():
    v, f = meshes.torus()
    samples = samples_of(v, f)
    expected = (REACH * testing.thickness(samples) / samples.frame.scale) ** 2
    assert np.allclose(testing.bending(samples, af.DeformOptions()), expected)
    assert np.allclose(testing.bending(samples, af.DeformOptions(bending=2.5)), 2.5 * expected)
    paper = af.DeformOptions(bending_unit="cube")
    assert np.allclose(testing.bending(samples, paper), 0.01)


def test_thickness_turns_and_scales_with_the_shape():
    """To rounding: the samples that it is measured at are chosen along the shape's own axes."""
    v, f = meshes.box((2.0, 1.0, 0.5))
    v = v + 0.3 * np.sin(3 * v[:, [1, 2, 0]])  # no symmetry
    motion = cases.turn([1, 2, 3], 37, (1.0, 0, 0))
    turned = 50.0 * (v @ motion[:3, :3].T + motion[:3, 3])
    rest, after = testing.thickness(samples_of(v, f)), testing.thickness(samples_of(turned, f))
    assert np.allclose(after, 50.0 * rest, rtol=1e-6)
    mirrored = testing.thickness(samples_of(v * [-1.0, 1, 1], f[:, ::-1]))
    assert abs(np.median(mirrored) / np.median(rest) - 1) < SAMPLED  # other samples: corners change places


def test_reports_contain_the_minimised_energy():
    """Its unit: none. With the same λ everywhere it is stretch + λ·bend."""
    samples = cases.bar_samples(2000)
    options = dict(field="radial", centers=100, bending_unit="cube", bending=3.0)
    report = af.deform(samples, cases.bar_handles(), af.DeformOptions(**options)).report
    assert np.isclose(report["energy"], report["stretch"] + 0.03 * report["bend"], rtol=1e-9)
    handles = cases.bar_handles()
    live = af.LiveDeformer(samples, handles, af.LiveOptions(bending_unit="cube", bending=3.0))
    live.solve([handle.target for handle in handles])
    assert np.isclose(live.report["energy"], live.report["stretch"] + 0.03 * live.report["bend"], rtol=1e-5)


@pytest.mark.parametrize("composed", [False, True])
def test_factors_of_points(composed):
    """The energy of points with factors is the mean of theirs, and so are its cotangents."""
    rng = np.random.default_rng(0)
    jets = rng.normal(size=(10, 40, 3))
    jets[1:4] += np.eye(3)[:, None]
    weights, bending = rng.uniform(0.1, 2, size=40), rng.uniform(0, 3, size=40)
    energy, cotangents = testing.arap_energy_by_points(jets, 0.7, weights, bending, composed=composed)
    total = 0.0
    for i in range(40):
        one = np.ascontiguousarray(jets[:, i : i + 1])
        stretch, bend, own = testing.arap_energy(one, 0.7 * bending[i], weights[i] / 40)
        total += weights[i] / 40 * (stretch + 0.7 * bending[i] * bend)
        assert np.allclose(cotangents[:, i : i + 1], own, atol=1e-12)
    assert np.isclose(energy, total, rtol=1e-12)
