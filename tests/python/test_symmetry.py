# SPDX-License-Identifier: GPL-3.0-or-later
"""Symmetry of fields, and results that motions of the mesh and the sides of its faces do not change."""

import numpy as np
import pytest
from support.geometry import cases, meshes
from support.geometry.cases import box, moved, turn
from support.geometry.characters import HIP, LEG, trousers

import arapfields as af

# Symmetry: of fields by construction, and of results under motions of the mesh.

# Fields that are symmetric by construction, on samples that are not.

REFLECTION = np.array([-1.0, 1, 1])
EXACT = 1e-6  # of the size: what is asked for; rounding is far below


@pytest.fixture(scope="module")
def body():
    return af.sample_surface(trousers(), 5000, seed=0)


def leg(side, degrees):
    rest = box([min(0, side), -1, -1], [max(0, side), 1, 0.4])
    return moved(rest, turn([1, 0.3 * side, 0.5 * side], degrees, (side * LEG, 0, HIP)))


TRUNK = moved(box([-1, -1, 0.9], [1, 1, 2]))


def asymmetry(field, points):
    return np.abs(field(points * REFLECTION) - field(points) * REFLECTION).max()


@pytest.fixture(scope="module")
def space():
    return np.random.default_rng(0).uniform([-0.5, -0.5, -0.2], [0.5, 0.5, 1.5], (4000, 3))


@pytest.mark.parametrize("centers", [150, 700])  # with a first result, and without
def test_one_leg_moves_both(body, space, centers):
    field = af.deform(body, [TRUNK, leg(1, 40)], af.DeformOptions(symmetry="x", centers=centers))
    assert asymmetry(field, space) < EXACT
    feet = body.points[body.points[:, 2] < 0.3]
    assert np.linalg.norm(field(feet) - feet, axis=1).min() > 0.1
    assert field.report.handle_error_mean < 0.02


def test_symmetric_handles_cost_no_more_than_without(body, space):
    handles = [TRUNK, leg(1, 40), leg(-1, 40)]
    free = af.deform(body, handles, af.DeformOptions(centers=300))
    tied = af.deform(body, handles, af.DeformOptions(centers=300, symmetry="x"))
    assert asymmetry(tied, space) < EXACT < asymmetry(free, space)
    assert tied.report.loss[-1][1] < 1.01 * free.report.loss[-1][1]


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_every_plane_through_the_origin(axis, space):
    """On a ball that is far from symmetric about any of them: the field is, all the same."""
    rng = np.random.default_rng(1)
    arms = rng.normal(size=(3000, 3))
    arms /= np.linalg.norm(arms, axis=1, keepdims=True)
    samples = af.SurfaceSamples(0.6 * arms + [0.1, 0.2, 0.7], arms)
    k = "xyz".index(axis)
    live = af.LiveDeformer(
        samples, [af.Point(samples.points[0], samples.points[0] + 0.2)], af.LiveOptions(symmetry=axis)
    )
    field, flip = live.solve(), np.where(np.arange(3) == k, -1.0, 1.0)
    assert np.abs(field(space * flip) - field(space) * flip).max() < EXACT
    assert np.abs(field(space) - space).max() > 0.05


def test_a_session_switches_it_during_a_drag(body, space):
    live = af.LiveDeformer(body, [TRUNK, leg(1, 0)])
    live.track(space)
    for degrees in (10, 20):
        free = live.solve([TRUNK.target, leg(1, degrees).target])
    live.set_symmetry("x")
    for degrees in (20, 30):
        tied = live.solve([TRUNK.target, leg(1, degrees).target], iterations=60)
        assert asymmetry(tied, space) < EXACT
    assert np.abs(live.tracked() - tied(space)).max() < 1e-3
    right = body.points[(body.points[:, 2] < 0.4) & (body.points[:, 0] > 0)]
    assert np.abs(tied(right) - live.field(right)).max() == 0
    live.set_symmetry("none")
    before = np.abs(live.field(right) - tied(right)).max()
    assert before < 0.02  # the shape is taken over
    again = live.solve([TRUNK.target, leg(1, 20).target], iterations=200, tolerance=1e-6)
    assert np.abs(again(right) - free(right)).max() < 0.03
    assert asymmetry(again, space) > EXACT
    with pytest.raises(af.InvalidInput, match="symmetry"):
        live.set_symmetry("w")
    assert np.array_equal(live.field(right), again(right))


def test_a_switched_session_reaches_the_energy_of_a_fresh_one(body):
    """Fewer steps serve since the shape at hand is the start."""
    handles = [TRUNK, leg(1, 30)]
    fresh = af.LiveDeformer(body, handles, af.LiveOptions(symmetry="x"))
    fresh.solve(iterations=200, tolerance=1e-7)
    live = af.LiveDeformer(body, handles)
    live.solve(iterations=200, tolerance=1e-7)
    live.set_symmetry("x")
    live.solve(iterations=200, tolerance=1e-7)
    assert live.report.value == pytest.approx(fresh.report.value, rel=1e-3)
    live.reset()
    assert np.abs(live.field(body.points) - body.points).max() < 1e-8


def test_styles_are_symmetric_too(body, space):
    live = af.LiveDeformer(body, options=af.LiveOptions(symmetry="x", interior=False))
    live.set_style("cube", 1.0)
    field = live.solve(iterations=30)
    assert asymmetry(field, space) < EXACT
    assert np.abs(field(body.points) - body.points).max() > 0.01


def test_symmetry_and_weights_agree(body, space):
    stiff = body.with_weights(np.where(body.points[:, 2] > HIP, 100.0, 1.0))
    live = af.LiveDeformer(stiff, [TRUNK, leg(1, 30)], af.LiveOptions(symmetry="x"))
    assert asymmetry(live.solve(iterations=50), space) < EXACT


def test_bad_symmetries_are_refused(body):
    handles = [TRUNK, leg(1, 10)]
    for options in (
        {"field": "neural"},
        {"exact_handles": True},
        {"width": 32},  # chooses a network
    ):
        with pytest.raises(af.InvalidInput, match="symmetry"):
            af.deform(body, handles, af.DeformOptions(symmetry="x", **options))
    with pytest.raises(af.InvalidInput, match="symmetry"):
        af.DeformOptions(symmetry="w")


# A radial result turns, scales and mirrors with its mesh, and does not see what is small and far away.

COUNT = 12000
# Mean distance over the surface, of the largest motion. Where triangles' corners or the list of triangles
# change, other samples stand for the same surface, and other centers among them.
SAME = 5e-3
ROUNDING = 3e-4  # a solve ends where its next step would gain a part in 100,000 of the energy


def blob():
    """A lopsided blob without symmetries."""
    v, f = meshes.sphere(subdivisions=4)
    return v * [1.6, 0.7, 0.5] + 0.12 * np.sin(2.0 * v[:, [1, 2, 0]] + [0.0, 1.0, 2.0]), f


def boxes():
    low, high = cases.box([-3, -2, -2], [-1.0, 2, 2]), cases.box([1.0, -2, -2], [3, 2, 2])
    return [low, high], [np.eye(4), cases.turn([0, 1, 0.3], 50, (0.2, 0, 0))]


def motion(placed, vertices, triangles, count=COUNT, centers=300):
    """Where the blob's vertices go after the similarity `placed`, brought back to where they were."""
    moved = vertices @ placed[:3, :3].T + placed[:3, 3]
    proper = np.diag([np.sign(np.linalg.det(placed[:3, :3])), 1, 1, 1])  # a box's axis may be turned over
    back = np.linalg.inv(placed)
    handles = [
        af.Cuboid(placed @ rest @ proper, placed @ move @ rest @ proper)
        for rest, move in zip(*boxes(), strict=True)
    ]
    samples = af.sample_mesh(moved, triangles, count=count)
    field = af.deform(samples, handles, af.DeformOptions(field="radial", centers=centers))
    return field(moved) @ back[:3, :3].T + back[:3, 3] - vertices


def off(found, expected):
    return np.linalg.norm(found - expected, axis=1).mean() / np.linalg.norm(expected, axis=1).max()


@pytest.fixture(scope="module")
def at_rest():
    return motion(np.eye(4), *blob())


SIMILARITIES = {
    "turned": cases.turn([1, 2, 3], 37),
    "turned over": cases.turn([1, 0, 0], 90),
    "moved": cases.shift([30.0, -20.0, 5.0]),
    "large": np.diag([1e4, 1e4, 1e4, 1.0]),
    "small": np.diag([1e-4, 1e-4, 1e-4, 1.0]),
}


@pytest.mark.parametrize("name", SIMILARITIES)
def test_similar_meshes_move_alike(at_rest, name):
    assert off(motion(SIMILARITIES[name], *blob()), at_rest) < ROUNDING


def test_a_mirrored_mesh_moves_mirrored(at_rest):
    """Triangles are turned over, so other points of them are drawn."""
    v, f = blob()
    samples_differ = motion(np.diag([-1.0, 1, 1, 1]), v, np.ascontiguousarray(f[:, ::-1]))
    assert off(samples_differ, at_rest) < SAME


def test_what_is_small_and_far_changes_nothing(at_rest):
    v, f = blob()
    small, g = meshes.sphere(0.02, subdivisions=1)
    both = np.concatenate([v, small + np.array([40.0, 25.0, -10.0])])
    shape = motion(np.eye(4), both, np.concatenate([f, g + len(v)]))[: len(v)]
    assert off(shape, at_rest) < SAME


# Meshes whose faces point inwards, all of them or some, give what the clean ones give.

TURNED = [0, 2, 1]  # order of corners that faces the other way


def sphere(radius=1.0, center=(0.0, 0.0, 0.0), rows=16, columns=24, lowest=0.0):
    """Vertices and triangles facing outwards; `lowest`: rows left out below, as a share, for an open neck."""
    angles = np.linspace(0.0, np.pi * (1.0 - lowest), rows + 1)
    around = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    place = np.array(
        [[(np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)) for b in around] for a in angles]
    ).reshape(-1, 3)
    faces = []
    for i in range(rows):
        for j in range(columns):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            c, d = a + columns, b + columns
            faces += [(a, c, d), (a, d, b)]
    return radius * place + np.asarray(center), np.array(faces)


def rope(turns=1.5, length=60, around=12, thickness=0.05):
    """A closed tube about a helix."""
    t = np.linspace(0.0, 1.0, length)
    a = 2.0 * np.pi * turns * t
    middle = np.c_[np.cos(a) * 0.5, np.sin(a) * 0.5, t - 0.5]
    along = np.gradient(middle, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    out = np.c_[np.cos(a), np.sin(a), 0.0 * a]
    side = np.cross(along, out)
    out = np.cross(side, along)
    b = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    ring = middle[:, None] + thickness * (
        np.cos(b)[None, :, None] * out[:, None] + np.sin(b)[None, :, None] * side[:, None]
    )
    vertices = np.vstack([ring.reshape(-1, 3), middle[[0, -1]]])
    faces, first, last = [], length * around, length * around + 1
    for i in range(length - 1):
        for j in range(around):
            p, q = i * around + j, i * around + (j + 1) % around
            faces += [(p, q, q + around), (p, q + around, p + around)]
    for j in range(around):
        faces += [(first, (j + 1) % around, j)]
        end = (length - 1) * around
        faces += [(last, end + j, end + (j + 1) % around)]
    faces = np.array(faces)
    corners = vertices[faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return vertices, faces if volume > 0.0 else faces[:, TURNED]


def together(*meshes):
    ends = np.cumsum([0] + [len(v) for v, _ in meshes])
    return np.vstack([v for v, _ in meshes]), np.vstack(
        [f + n for (_, f), n in zip(meshes, ends, strict=False)]
    )


def turned(triangles, which):
    result = triangles.copy()
    result[which] = result[which][:, TURNED]
    return result


SHAPES = {
    "sphere": sphere(),
    "rope": rope(),
    "two apart": together(sphere(0.5), sphere(0.3, (2.0, 0.0, 0.0))),
    "hollow": together(sphere(1.0), (sphere(0.7)[0], sphere(0.7)[1][:, TURNED])),
    "eyeball": together(sphere(1.0), sphere(0.2, (0.0, 0.6, 0.1))),
    "open neck": sphere(lowest=0.12),
    "half": sphere(lowest=0.5),
    "head with eyes": meshes.suzanne(),  # each less than half of a ball
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("share", [1.0, 0.45])
def test_faces_that_point_inwards_are_turned_for_sampling(name, share):
    vertices, triangles = SHAPES[name]
    rng = np.random.default_rng(5)
    wrong = turned(triangles, rng.random(len(triangles)) < share)
    clean, mended = af.sample_mesh(vertices, triangles), af.sample_mesh(vertices, wrong)
    assert np.array_equal(clean.points, mended.points)
    assert np.array_equal(clean.normals, mended.normals)


@pytest.mark.parametrize("name", ["sphere", "hollow", "eyeball"])
def test_signed_distances_do_not_depend_on_where_faces_point(name):
    vertices, triangles = SHAPES[name]
    points = np.random.default_rng(6).uniform(-1.2, 1.2, (200, 3))
    inwards = turned(triangles, slice(None))
    expected = af.signed_distance(vertices, triangles, points)
    assert np.array_equal(af.signed_distance(vertices, inwards, points), expected)
    sdf, other = af.MeshSdf(vertices, triangles), af.MeshSdf(vertices, inwards)
    cube = sdf.frame.to_cube(points) if hasattr(sdf.frame, "to_cube") else points
    assert np.array_equal(other(cube), sdf(cube))


def test_a_rope_inside_out_is_as_soft_as_the_clean_one():
    vertices, triangles = rope()
    low, high = vertices.min(0), vertices.max(0)
    held = moved(box(low - 0.1, (*(high + 0.1)[:2], low[2] + 0.15)))
    pulled = moved(box((*(low - 0.1)[:2], high[2] - 0.15), high + 0.1), turn((0, 0, 1), 60.0))
    fields = [
        af.deform(af.sample_mesh(vertices, faces), [held, pulled])
        for faces in (triangles, turned(triangles, slice(None)))
    ]
    assert fields[1].report.energy == fields[0].report.energy
    assert np.array_equal(
        fields[1].apply(vertices, triangles=turned(triangles, slice(None))),
        fields[0].apply(vertices, triangles=triangles),
    )


def test_open_sheets_keep_the_side_that_they_face():
    x = np.linspace(-1.0, 1.0, 9)
    grid = np.array([(a, b, 0.2 * a * a) for a in x for b in x])
    faces = np.array(
        [
            f
            for i in range(8)
            for j in range(8)
            for f in (
                (9 * i + j, 9 * i + j + 9, 9 * i + j + 10),
                (9 * i + j, 9 * i + j + 10, 9 * i + j + 1),
            )
        ]
    )
    up = af.sample_mesh(grid, faces).normals[:, 2]
    down = af.sample_mesh(grid, turned(faces, slice(None))).normals[:, 2]
    assert np.array_equal(up, -down)
    few = turned(faces, np.arange(0, len(faces), 7))
    assert np.array_equal(af.sample_mesh(grid, few).normals[:, 2], up)


def test_a_strip_with_one_side_is_sampled():
    a = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    middle = np.c_[np.cos(a), np.sin(a), 0 * a]
    arm = np.c_[np.cos(a / 2) * np.cos(a), np.cos(a / 2) * np.sin(a), np.sin(a / 2)]
    vertices = np.vstack([middle - 0.2 * arm, middle + 0.2 * arm])
    n = len(a)
    faces = [(i, i + 1, i + 1 + n) for i in range(n - 1)] + [(i, i + 1 + n, i + n) for i in range(n - 1)]
    faces += [(n - 1, n, 0), (n - 1, 0, 2 * n - 1)]
    samples = af.sample_mesh(vertices, np.array(faces))
    assert np.allclose(np.linalg.norm(samples.normals, axis=1), 1.0)
