# SPDX-License-Identifier: GPL-3.0-or-later
"""Live deformation of parts that are near in space but apart along the shape."""

import numpy as np
import pytest
import safetensors
from support.geometry import meshes
from support.geometry.bar import bar_samples
from support.geometry.cases import shift
from support.geometry.fork import BOTTOM, LEGS, TIP, fork_samples

import arapfields as af

# Single precision, of coefficients that nearly cancel between the layers of centers.
SINGLE = 1e-4
# A step of a handle: what it pulls at is never farther from where it goes.
LEFT_BEHIND = 0.02


@pytest.fixture(scope="module")
def samples():
    return fork_samples()


def other_leg_moves(samples, interior):
    """Distance by which the left tip moves when the right one is pulled aside, and the live deformer."""
    handles = [af.Cuboid(BOTTOM, BOTTOM), af.Cuboid(TIP, TIP)]
    live = af.LiveDeformer(samples, handles, af.LiveOptions(interior=interior))
    field = live.solve([BOTTOM, shift([0, 0.4, 0]) @ TIP], iterations=100, tolerance=1e-6)
    assert live.report.handle_error_mean < 0.01
    return np.linalg.norm(field(LEGS[-1]) - LEGS[-1]), live


def test_a_leg_of_a_fork_moves_alone(samples):
    apart, live = other_leg_moves(samples, True)
    together, plain = other_leg_moves(samples, False)
    assert apart < 0.04 * 1.5  # of the fork's length
    assert together > 2 * apart
    assert live.report.energy < plain.report.energy


def test_derivatives_and_files_of_such_a_field(samples, tmp_path):
    _, live = other_leg_moves(samples, True)
    field = live.field
    rng = np.random.default_rng(3)
    points = np.r_[samples.points[:40], rng.uniform(-0.6, 0.6, size=(40, 3)), [[5.0, 5, 5]]]
    step = 2e-6
    for k in range(3):
        offset = step * np.eye(3)[k]
        slope = (field(points + offset) - field(points - offset)) / (2 * step)
        jacobian, hessian = field.jacobian(points), field.hessian(points)
        assert np.abs(slope - jacobian[:, :, k]).max() < 1e-6
        slope = (field.jacobian(points + offset) - field.jacobian(points - offset)) / (2 * step)
        assert np.abs(slope - hessian[:, :, :, k]).max() < 1e-5 * np.abs(hessian).max()
    field.save(tmp_path / "fork.safetensors")
    again = af.DeformationField.load(tmp_path / "fork.safetensors")
    assert np.array_equal(again(points), field(points))
    assert np.array_equal(again.hessian(points), field.hessian(points))
    live.track(points)
    assert np.abs(live.tracked() - field(points)).max() < SINGLE
    live.reset()
    assert np.abs(live.field(points) - points).max() < 1e-8


def test_a_convex_shape_needs_no_lift(samples, tmp_path):
    for surface, embedded in ((bar_samples(), False), (samples, True)):
        live = af.LiveDeformer(surface, [af.Point(surface.points[0], surface.points[0])])
        live.field.save(tmp_path / "field.safetensors")
        with safetensors.safe_open(tmp_path / "field.safetensors", "np") as saved:
            names = list(saved.keys())
        assert any(name.startswith("embedding.") for name in names) == embedded


def test_loose_parts_stay_together():
    """Two balls that do not touch: what nothing joins is joined by the shortest line, and follows."""
    rng = np.random.default_rng(5)
    normals = rng.normal(size=(6000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = 0.5 * normals + np.where(np.arange(6000) < 3000, -0.6, 0.6)[:, None] * [1.0, 0, 0]
    pin = af.Point([-1.1, 0, 0], [-1.1, 0, 0])
    live = af.LiveDeformer(af.SurfaceSamples(points, normals), [pin], af.LiveOptions(locality=0))
    field = live.solve([[-1.1, 0.5, 0]], iterations=100)
    assert np.abs(field(points) - points - [0, 0.5, 0]).max() < 0.05


def test_a_held_speck_beside_a_ball_swings_with_it():
    """Chosen by chance, none of the samples that the handle pulls at would be of it."""
    ball, speck = meshes.sphere(1.0, 4), meshes.box((0.01, 0.01, 0.01))
    v = np.concatenate([ball[0], speck[0] + [0.0, 0.0, 2.0]])
    samples = af.sample_mesh(v, np.concatenate([ball[1], speck[1] + len(ball[0])]), count=6000, seed=2)
    live = af.LiveDeformer(samples, [af.Region(list(range(6000)), np.eye(4), np.eye(4))])
    live.set_secondary_motion(af.SecondaryMotionOptions())
    for step in range(1, 9):
        way = [0.02 * step, 0.0, 0.0]
        moved = live.step([shift(way)], 1 / 24)(v)
        assert np.linalg.norm(moved - v - way, axis=1).max() < LEFT_BEHIND
