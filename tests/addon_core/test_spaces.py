# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry of the extension: spaces, handles, rotations, edges, what fits a body, what a pin's ball holds."""

import numpy as np
import pytest
from support.geometry.blocks import block_surface
from support.geometry.meshes import sphere

import arapfields as af
from addon.core.errors import UserError
from addon.core.geometry import spaces, transfer
from addon.core.geometry.edges import build_edges, closest_points
from addon.core.geometry.handles import Handle, box_matrix, require_held, solve_handle
from addon.core.geometry.spaces import inverse, pose, rigid_motion, space_of, transform, upright
from addon.core.geometry.transfer import carried_marks

# Geometry of the extension: solve space, handles, rotations, edges of meshes, what fits a wrapped body.

# Geometry of the extension: solve space, handles, rotations, edges of meshes.

# Solve space and handles: the world up to a similarity, rigid motions under any scale, mirror and parent.

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


def test_a_box_contains_the_points_inside_it():
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


def test_the_closest_rotations_are_those_of_the_singular_values():
    """Near rotations, folded ones, flat ones, the zero matrix."""
    rng = np.random.default_rng(5)
    scales = np.array([(1, 1, 1), (1.3, 1, 0.8), (3, 1, 0.1), (1, 1, -0.5), (1, 0.5, 1e-14), (40, 2, 1)])
    left, right = (np.linalg.qr(rng.normal(size=(len(scales), 3, 3)))[0] for _ in range(2))
    left, right = (q * np.sign(np.linalg.det(q))[:, None, None] for q in (left, right))
    found = spaces.closest(np.einsum("nij,nj,njk->nik", left, scales, right))
    assert np.abs(found - left @ right).max() < EXACT
    zero = spaces.closest(np.zeros((1, 3, 3)))[0]
    assert np.abs(zero @ zero.T - np.eye(3)).max() < EXACT and np.linalg.det(zero) > 0
    assert np.isnan(spaces.closest(np.full((1, 3, 3), np.nan))).all()


# Edges of triangle meshes, against a search one by one.

TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


@pytest.mark.parametrize("corners", [TETRAHEDRON, TETRAHEDRON[:2], TETRAHEDRON[:1]])
def test_every_edge_occurs_once(corners):
    topology = build_edges(np.array(corners))
    expected = {tuple(sorted((t[k], t[(k + 1) % 3]))) for t in corners for k in range(3)}
    assert len(topology) == len(corners)
    assert sorted(map(tuple, topology.edges)) == sorted(expected)
    for triangle, edges in zip(corners, topology.corner_edges, strict=True):
        for k in range(3):
            assert tuple(topology.edges[edges[k]]) == tuple(sorted((triangle[k], triangle[(k + 1) % 3])))


def test_large_numbers_of_vertices_do_not_overflow():
    last = 2**31 - 1
    topology = build_edges(np.array([[last - 2, last - 1, last]]))
    assert sorted(map(tuple, topology.edges)) == [(last - 2, last - 1), (last - 2, last), (last - 1, last)]


def grid(columns, rows, shift=0.0):
    """(n, 3), (m, 2), [quads]: a unit sheet, its inner vertices moved at random."""
    x, y = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    inner = (points[:, :2] > 0).all(axis=1) & (points[:, :2] < 1).all(axis=1)
    points[inner, :2] += shift * np.random.default_rng(0).uniform(-1, 1, (inner.sum(), 2))
    at = np.arange(len(points)).reshape(x.shape)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    edges = np.unique(np.sort(np.stack([quads, np.roll(quads, -1, 1)], -1).reshape(-1, 2), axis=1), axis=0)
    return points, edges, quads


def test_a_marked_line_stays_one_line_on_other_edges():
    vertices, edges, _ = grid(13, 13, 0.02)
    line = np.stack([np.full(6, 0.45), np.linspace(0, 1, 6), np.zeros(6)], axis=1)
    ends = np.stack([line[:-1], line[1:]], axis=1)
    nearest = ((vertices[None] - ends.reshape(-1, 1, 3)) ** 2).sum(-1).argmin(1).reshape(-1, 2)
    found = carried_marks(ends, np.full(5, 0.7), nearest, vertices, edges)
    chosen = edges[found > 0]
    assert set(found[found > 0]) == {0.7} and len(chosen) == 13
    assert np.abs(vertices[chosen][:, :, 0] - 0.45).max() < 0.08
    assert sorted(np.bincount(chosen.ravel())[np.unique(chosen)]) == [1, 1] + [2] * 12


def test_a_face_across_a_seam_keeps_the_texture_of_its_centre():
    """Two islands meet at x = 0.5; the other mesh has faces across."""
    source, _, quads = grid(4, 4)
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    right = source[triangles].mean(axis=1)[:, 0] > 0.5
    uv = source[triangles][:, :, :2] + right[:, None, None] * [5.0, 0.0]
    vertices, _, faces = grid(5, 3)
    corners, starts = faces.ravel(), 4 * np.arange(len(faces))
    points, _, face = transfer.fan(vertices, starts, corners)
    centres = source[triangles].mean(axis=1)
    places = ((points[:, None] - centres) ** 2).sum(-1).argmin(1)
    edges = np.stack([source[triangles][:, k] for k in range(3)], axis=2)[places]
    shares = np.linalg.solve(
        edges + [[0], [0], [1]] * np.ones((1, 3, 3)), (points + np.eye(3)[2])[:, :, None]
    )
    found, beyond = transfer.corner_coordinates(
        points, places, shares[:, :, 0], corners, face, source[triangles], uv
    )
    across = points[len(vertices) :][face][:, 0] > 0.5
    assert beyond.any() and len(set(face[beyond].tolist())) <= 6
    told = vertices[corners][:, :2]
    off = found - told - across[:, None] * [5.0, 0.0]
    middle = np.abs(points[len(vertices) :][face][:, 0] - 0.5) < 1e-9  # whose centre is on the seam itself
    assert np.abs(off[~middle]).max() < 1e-9
    assert (np.ptp(found.reshape(-1, 4, 2)[:, :, 0], axis=1) < 0.3).all()


# What a body carries, fitted to the body that it was wrapped onto.

DISTANCE = 0.02  # of clothes from a ball of radius 1
CLOSE = 0.2  # of that
SAME = 1e-9  # of the radius: sums in another order
STILL = 1e-3  # of the radius: what hardly counts moves by no more


@pytest.fixture
def ball():
    return sphere(1.0, 4)


def test_clothes_keep_their_distance_after_a_wrap(ball):
    v, f = ball
    body = transfer.Body(af, (v, v, f), (v, f))
    for left in (-0.5, 0.2):
        shape = body.fit((1 + DISTANCE) * v, (1 + left * DISTANCE) * v, f)
        assert np.abs(af.MeshSdf(v, f)(shape) / DISTANCE - 1).max() < CLOSE


def test_points_far_from_the_skin_follow_the_wrap(ball):
    """A body that grows to four times its size: a hat that does not need not be pushed away."""
    v, f = ball
    body = transfer.Body(af, (v / 4, v, f), (v, f))
    hat = 1.3 * v
    assert np.abs(body.fit(0.75 * v, hat, f) - hat).max() < STILL


def test_where_the_other_body_has_a_gap_clothes_stay(ball):
    """As under an avatar's clothes, where its skin is removed."""
    v, f = ball
    kept = (v[f] @ [0, 0, 1]).max(axis=1) < 0.3
    body = transfer.Body(af, (v, v, f), (v, f[kept]))
    worn = (1 + DISTANCE) * v
    shape, above = body.fit(worn, worn, f), v[:, 2] > 0.7
    assert np.abs(shape - worn)[above].max() < STILL


def test_clothes_whose_vertices_are_split_at_seams_stay_closed():
    """As game formats write them: each triangle by itself. They go where the joined ones go."""
    v, f = sphere(1.0, 4)
    body = transfer.Body(af, (v, v, f), (v, f))
    near = 1 + DISTANCE * (0.2 + 0.1 * np.sin(9 * v))
    joined = body.fit((1 + DISTANCE) * v, near * v, f)
    split = body.fit(
        (1 + DISTANCE) * v[f].reshape(-1, 3), (near * v)[f].reshape(-1, 3), np.arange(f.size).reshape(-1, 3)
    )
    assert np.abs(split - joined[f].reshape(-1, 3)).max() < SAME


# What a pin's ball holds: what is connected with its place through the shape, and near by.


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
