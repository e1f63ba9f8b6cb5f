# SPDX-License-Identifier: GPL-3.0-or-later
"""Solve space and handles: the world up to a similarity, rigid motions under any scale, mirror and parent."""

import numpy as np
import pytest

from addon.core.errors import UserError
from addon.core.geometry.handles import box_matrix, require_held, solve_handle
from addon.core.geometry.spaces import inverse, pose, rigid_motion, space_of, transform, upright

EXACT = 1e-9  # float64 arithmetic on numbers near one


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def world_matrix(rng, scales, shear=0.0):
    matrix = np.eye(4)
    skew = np.eye(3) + shear * np.triu(rng.normal(size=(3, 3)), 1)
    matrix[:3, :3] = rotation(rng) @ skew @ np.diag(scales) @ rotation(rng)
    matrix[:3, 3] = rng.normal(size=3)
    return matrix


CASES = {
    "even": ((2.0, 2.0, 2.0), 0.0),
    "mirrored": ((1.0, 1.0, -1.0), 0.0),
    "uneven": ((0.5, 2.0, 3.0), 0.0),
    "sheared and mirrored": ((0.5, -2.0, 3.0), 0.4),
    "tiny": ((1e-3, 2e-3, 1e-3), 0.0),
    "huge": ((1e3, 1e3, 3e3), 0.1),
}


@pytest.mark.parametrize("name", CASES)
def test_the_inverse_of_an_affine_matrix(name):
    matrix = world_matrix(np.random.default_rng(3), *CASES[name])
    assert np.abs(inverse(matrix) @ matrix - np.eye(4)).max() < EXACT
    assert np.abs(matrix @ inverse(matrix) - np.eye(4)).max() < EXACT


@pytest.mark.parametrize("name", CASES)
def test_the_two_halves_make_the_world_matrix(name):
    rng = np.random.default_rng(0)
    world = world_matrix(rng, *CASES[name])
    space = space_of(world)
    points = rng.normal(size=(50, 3))
    through = transform(space.solve_to_world, space.to_solve(points))
    assert np.allclose(through, transform(world, points), rtol=0, atol=EXACT * np.abs(world).max())
    assert np.allclose(space.to_local(space.to_solve(points)), points, atol=EXACT)


@pytest.mark.parametrize("name", CASES)
def test_solve_space_keeps_angles_and_ratios_of_the_world(name):
    world = world_matrix(np.random.default_rng(1), *CASES[name])
    linear = space_of(world).solve_to_world[:3, :3]
    gram = linear.T @ linear
    assert np.allclose(gram, gram[0, 0] * np.eye(3), atol=EXACT * gram[0, 0])


def test_a_moved_or_evenly_scaled_object_keeps_its_solve_space():
    rng = np.random.default_rng(2)
    one = world_matrix(rng, (1.0, 2.0, 0.5))
    other = np.eye(4)
    other[:3, :3] = 7.0 * rotation(rng)
    other[:3, 3] = 5.0
    assert np.allclose(space_of(one).local_to_solve, space_of(other @ one).local_to_solve, atol=EXACT)
    assert np.array_equal(space_of(other).local_to_solve, np.eye(4))


@pytest.mark.parametrize("scales", [(0.0, 1.0, 1.0), (0.0, 0.0, 0.0), (1e-9, 1.0, 1.0)])
def test_a_flattening_scale_is_refused(scales):
    with pytest.raises(UserError, match="Cube: its scale flattens it"):
        space_of(np.diag([*scales, 1.0]), "Cube")


@pytest.mark.parametrize("name", CASES)
def test_a_handle_moves_alike_in_solve_space_and_in_the_world(name):
    rng = np.random.default_rng(3)
    world = world_matrix(rng, *CASES[name])
    space = space_of(world)
    rest = world_matrix(rng, (0.3, 0.2, 0.5))
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = rotation(rng), rng.normal(size=3)
    handle = solve_handle("Empty", "CUBE", np.linalg.inv(world) @ rest, world, motion @ rest, space)
    in_solve = handle.target @ np.linalg.inv(handle.rest)
    points = rng.normal(size=(20, 3))
    moved = transform(space.solve_to_world, transform(in_solve, points))
    expected = transform(motion, transform(space.solve_to_world, points))
    scale = max(1.0, np.abs(world).max())
    assert np.allclose(moved, expected, atol=1e-8 * scale)
    assert np.allclose(in_solve[:3, :3] @ in_solve[:3, :3].T, np.eye(3), atol=EXACT)
    assert np.linalg.det(in_solve[:3, :3]) > 0 and np.linalg.det(handle.rest[:3, :3]) > 0


def test_an_unmoved_handle_is_exactly_an_anchor():
    rng = np.random.default_rng(4)
    world, rest = world_matrix(rng, (1.0, 3.0, -2.0)), world_matrix(rng, (0.3, 0.2, 0.5))
    at_rest = "Empty", "CUBE", np.linalg.inv(world) @ rest, world
    assert solve_handle(*at_rest, rest + 1e-8, space_of(world)).is_anchor
    shifted = rest.copy()
    shifted[:3, 3] += 1e-3
    assert not solve_handle(*at_rest, shifted, space_of(world)).is_anchor


def test_scaling_a_handle_after_its_rest_is_no_motion():
    rest = world_matrix(np.random.default_rng(5), (0.5, 0.5, 0.5))
    grown = rest.copy()
    grown[:3, :3] *= 3.0
    assert np.allclose(rigid_motion(rest, grown), np.eye(4), atol=EXACT)
    assert np.allclose(pose(grown), pose(rest), atol=EXACT)


def test_a_box_is_the_emptys_cube():
    matrix = np.diag([1.0, 2.0, 3.0, 1.0])
    corner = transform(box_matrix(matrix, 0.5), np.array([[1.0, 1.0, 1.0]]))
    assert np.allclose(corner, [[0.5, 1.0, 1.5]])


def test_a_box_holds_what_is_inside_it():
    rest = np.diag([1.0, 2.0, 3.0, 1.0])
    handle = solve_handle("Empty", "CUBE", rest, np.eye(4), rest, space_of(np.eye(4)))
    points = np.array([[0.9, 1.9, -2.9], [1.1, 0, 0], [0, 2.1, 0], [0, 0, -3.1]])
    assert handle.inside(points).tolist() == [True, False, False, False]


def test_handles_that_hold_nothing_are_named():
    with pytest.raises(UserError, match=r"rest region of bare, empty$"):
        require_held({"bare": 0, "full": 3, "empty": 0})


def test_a_flat_box_is_refused():
    with pytest.raises(UserError, match="Empty: its box is flat"):
        solve_handle("Empty", "CUBE", np.diag([1.0, 1.0, 0.0, 1.0]), *2 * [np.eye(4)], space_of(np.eye(4)))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1, -1])
def test_upright_axes_stand_and_head_where_the_object_does(axis, sign):
    """Whichever axis points up: z is the world's up, x is level and lies along one of the object's axes."""
    rng = np.random.default_rng(axis)
    turn = np.roll(np.eye(3), axis, axis=0) * [1, sign, sign]
    angle = rng.uniform(0, 2 * np.pi)
    about = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    axes = upright(about @ turn)
    assert np.allclose(axes.T @ axes, np.eye(3)) and np.linalg.det(axes) > 0
    assert np.array_equal(axes[:, 2], [0, 0, 1])
    assert np.isclose(np.abs((about @ turn).T @ axes[:, 0]).max(), 1)
    assert np.allclose(upright(about), about)
