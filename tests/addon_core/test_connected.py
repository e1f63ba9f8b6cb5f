# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pin's ball holds: what is connected with its place through the shape, and near by."""

import numpy as np
import pytest
from support.geometry.blocks import block_surface

from addon.core.geometry.edges import closest_points
from addon.core.geometry.handles import Handle


def pinned(place, radius, points, mesh):
    """Points of the surface that a pin at a place holds."""
    rest = np.diag([radius, radius, radius, 1.0])
    rest[:3, 3] = place
    return points[Handle("Pin", "PIN", rest, rest).pinned(points, *mesh)]


def samples(mesh, count=4000, seed=3):
    random = np.random.default_rng(seed)
    a, b, c = np.moveaxis(mesh[0][mesh[1]], 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = random.choice(len(areas), count, p=areas / areas.sum())
    u, v = np.sqrt(random.random(count)), random.random(count)
    shares = np.stack([1 - u, u * (1 - v), u * v], axis=1)
    return (mesh[0][mesh[1][chosen]] * shares[..., None]).sum(axis=1)


def jaws(gap, flipped=False):
    """Two bars of length 2 along x, at −y and +y, with a gap between them, joined from x = −1 to −0.8."""
    sides = [((-1, s * gap / 2, -0.1), (1, s * (gap / 2 + 0.2), 0.1)) for s in (1, -1)]
    boxes = [(np.minimum(low, high), np.maximum(low, high)) for low, high in sides]
    boxes.append(((-1, -gap / 2, -0.1), (-0.8, gap / 2, 0.1)))
    vertices, triangles = block_surface(boxes, (0.1, 0.1, 0.1))
    return vertices, triangles[:, ::-1] if flipped else triangles


@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize("gap", [0.02, 1e-4])
@pytest.mark.parametrize("place", [(0.5, 0.1, 0.1), (0.5, 0.0, 0.1), (0.5, 0.2, 0.0), (0.9, 0.02, -0.1)])
def test_a_pin_holds_one_of_two_parts_that_nearly_touch(gap, place, flipped):
    mesh = jaws(gap, flipped)
    points = samples(mesh)
    place = np.add(place, (0, gap / 2 + 1e-6, 0))
    in_ball = points[np.linalg.norm(points - place, axis=1) < 0.3]
    assert (in_ball[:, 1] < 0).sum() > 50, "the ball reaches the other jaw"
    held = pinned(place, 0.3, points, mesh)
    assert np.array_equal(np.unique(held, axis=0), np.unique(in_ball[in_ball[:, 1] > 0], axis=0))


def test_near_the_hinge_a_pin_holds_both_parts():
    mesh = jaws(0.02)
    points = samples(mesh)
    held = pinned((-0.8, 0.1, 0.1), 0.3, points, mesh)
    assert np.array_equal(held, points[np.linalg.norm(points - (-0.8, 0.1, 0.1), axis=1) <= 0.3])


def test_the_other_side_of_a_thin_plate_is_held_through_it():
    mesh = block_surface([((-1, -1, 0), (1, 1, 0.02))], (0.1, 0.1, 0.1))
    points = samples(mesh)
    held = pinned((0.1, 0.2, 0.02), 0.3, points, mesh)
    assert np.array_equal(held, points[np.linalg.norm(points - (0.1, 0.2, 0.02), axis=1) <= 0.3])
    assert (held[:, 2] == 0).sum() > 50


def test_a_small_pin_takes_the_nearest_points_of_its_own_part():
    mesh = jaws(1e-4)
    points = samples(mesh, 400)
    held = pinned((0.5, 0.01, 0.1), 1e-3, points, mesh)
    own = points[points[:, 1] > 0]
    away = np.linalg.norm(own - (0.5, 0.01, 0.1), axis=1)
    assert np.array_equal(np.sort(held, axis=0), np.sort(own[np.argsort(away)[:12]], axis=0))


def test_points_without_triangles_are_held_by_distance():
    points = np.random.default_rng(1).uniform(-1, 1, (500, 3))
    none = points, np.zeros((0, 3), dtype=np.int64)
    held = pinned((0, 0, 0), 0.5, points, none)
    assert np.array_equal(held, points[np.linalg.norm(points, axis=1) <= 0.5])


def test_the_closest_points_of_triangles_are_the_nearest_of_many():
    random = np.random.default_rng(0)
    points, corners = random.normal(size=(30, 3)), random.normal(size=(20, 3, 3))
    corners[0] = corners[0, 0]  # without area
    corners[1, 2] = corners[1, 1]
    steps = np.linspace(0, 1, 50)
    u, v = (x.ravel() for x in np.meshgrid(steps, steps))
    u, v = u[u + v <= 1], v[u + v <= 1]
    shares = np.stack([1 - u - v, u, v], axis=1)
    many = np.einsum("sk,mkx->msx", shares, corners)
    least = np.linalg.norm(points[:, None, None] - many, axis=3).min(axis=2)
    found = np.linalg.norm(closest_points(points, corners) - points[:, None], axis=2)
    assert (found <= least + 1e-12).all() and (found >= least - 0.15).all()
    on_plane = np.einsum(
        "sk,mkx->msx", shares[::100], corners
    )  # a point of a triangle is its own closest one
    for k, own in enumerate(on_plane):
        assert np.abs(closest_points(own, corners[k : k + 1])[:, 0] - own).max() < 1e-9
