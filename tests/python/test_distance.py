# SPDX-License-Identifier: GPL-3.0-or-later
"""Signed distances and winding numbers against libigl, and what they must not depend on."""

import igl
import numpy as np
import pytest
from support import tolerances
from support.geometry import meshes

import arapfields as af


def flat_sheet(resolution=30):
    """An open, wavy square."""
    x, y = np.meshgrid(*2 * [np.linspace(-1, 1, resolution)], indexing="ij")
    points = np.stack([x, y, 0.2 * np.sin(3 * x) * np.cos(2 * y)], -1).reshape(-1, 3)
    return points, meshes.grid_triangles(resolution, resolution)


def overlapping_tori():
    v, f = meshes.torus()
    return np.concatenate([v, v[:, [2, 0, 1]] * 0.9 + 0.3]), np.concatenate([f, f + len(v)])


def gappy_sphere():
    """A sphere without every tenth triangle, with duplicates and triangles without area."""
    v, f = meshes.sphere(subdivisions=4)
    kept = f[np.arange(len(f)) % 10 != 0]
    return v, np.concatenate(
        [kept, kept[:40], np.repeat(kept[:20, :1], 3, axis=1), kept[20:40][:, [0, 0, 1]]]
    )


CLOSED = {
    "sphere": meshes.sphere,
    "box": lambda: meshes.box((1.0, 0.6, 0.3)),
    "torus": meshes.torus,
    "overlapping tori": overlapping_tori,
}
OPEN = {"sheet": flat_sheet, "gappy sphere": gappy_sphere}


def queries(v, f, count, seed=0):
    """Half uniform in a box around the mesh, half near the surface; and the box's diagonal."""
    rng = np.random.default_rng(seed)
    low, high = v.min(0), v.max(0)
    diagonal = np.linalg.norm(high - low)
    near = af.sample_mesh(v, f, count - count // 2, seed=seed).points
    near = near + rng.normal(0, 0.01 * diagonal, near.shape)
    return np.concatenate(
        [rng.uniform(low - 0.1 * diagonal, high + 0.1 * diagonal, (count // 2, 3)), near]
    ), diagonal


def check_against_libigl(v, f, count, agreement, exact_winding=False):
    points, diagonal = queries(v, f, count)
    distances = af.signed_distance(v, f, points)
    squared, _, _ = igl.point_mesh_squared_distance(points, v, f)
    magnitude = np.abs(distances)
    assert np.abs(magnitude - np.sqrt(squared)).max() <= tolerances.DISTANCE * diagonal
    winding = igl.winding_number if exact_winding else igl.fast_winding_number
    inside = winding(v, f, points) > 0.5
    assert np.mean((distances < 0) == inside) >= agreement
    assert 0.01 < inside.mean() < 0.99


@pytest.mark.parametrize("name", CLOSED)
def test_closed_meshes_agree_with_libigl(name):
    v, f = CLOSED[name]()
    check_against_libigl(v, f, 20000, tolerances.SIGN_AGREEMENT_CLOSED)
    check_against_libigl(v, f, 4000, tolerances.SIGN_AGREEMENT_CLOSED, exact_winding=True)


@pytest.mark.parametrize("name", OPEN)
def test_open_meshes_agree_with_libigl(name):
    v, f = OPEN[name]()
    check_against_libigl(v, f, 4000, tolerances.SIGN_AGREEMENT_OPEN, exact_winding=True)


def test_suzanne_agrees_with_libigl():
    v, f = meshes.suzanne()
    check_against_libigl(v, f, 20000, tolerances.SIGN_AGREEMENT_OPEN, exact_winding=True)
    v, f = meshes.subdivide(*meshes.subdivide(v, f))
    check_against_libigl(v, f, 50000, tolerances.SIGN_AGREEMENT_OPEN)


@pytest.mark.parametrize("name", ["spot.obj", "bunny.off", "rockerArm.obj"])
def test_scans_and_models_agree_with_libigl(data_dir, name):
    v, f = meshes.read(data_dir / "meshes" / name)
    check_against_libigl(v, f, 40000, tolerances.SIGN_AGREEMENT_CLOSED)


@pytest.mark.parametrize("name", [*CLOSED, *OPEN])
def test_winding_numbers_equal_sums_of_solid_angles(name):
    v, f = (CLOSED | OPEN)[name]()
    points, _ = queries(v, f, 3000, seed=5)
    assert (
        np.abs(af.winding_number(v, f, points) - igl.winding_number(v, f, points)).max() < tolerances.WINDING
    )


def test_a_sphere_of_many_triangles_has_the_distance_of_a_sphere():
    v, f = meshes.sphere(radius=2.0, subdivisions=6)
    points, _ = queries(v, f, 5000, seed=1)
    expected = np.linalg.norm(points, axis=1) - 2.0
    edge = np.linalg.norm(v[f[:, 0]] - v[f[:, 1]], axis=1).max()
    sagitta = edge**2 / 2.0  # a chord of the sphere leaves it by less
    assert np.abs(af.signed_distance(v, f, points) - expected).max() < sagitta


def test_motion_and_scale_carry_over():
    v, f = meshes.torus()
    points, diagonal = queries(v, f, 3000, seed=2)
    reference = af.signed_distance(v, f, points)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    for scale, shift in ((1e-6, 0.0), (1.0, 1e4), (1e6, 3e7), (1e-200, 0.0), (1e150, 0.0)):
        moved = af.signed_distance(scale * v @ turn.T + shift, f, scale * points @ turn.T + shift)
        rounding = 1e-13 * diagonal + 1e-15 * abs(shift) / scale
        assert np.abs(moved / scale - reference).max() < rounding


def test_result_depends_neither_on_threads_nor_on_other_points():
    v, f = meshes.suzanne()
    points, _ = queries(v, f, 5000, seed=4)
    for function in (af.signed_distance, af.winding_number):
        reference = function(v, f, points, threads=1)
        assert np.array_equal(reference, function(v, f, points, threads=2))
        assert np.array_equal(reference, function(v, f, points, threads=7))
    reference = af.winding_number(v, f, points)
    assert np.array_equal(reference[1000:1003], af.winding_number(v, f, points[1000:1003]))


def test_inverted_meshes_have_the_inside_that_they_enclose():
    v, f = meshes.sphere()
    points, _ = queries(v, f, 1000)
    assert np.allclose(
        af.signed_distance(v, f[:, ::-1], points), af.signed_distance(v, f, points), atol=1e-12
    )


def test_points_on_the_surface_and_no_points():
    v, f = meshes.box()
    assert np.array_equal(np.abs(af.signed_distance(v, f, v)), np.zeros(len(v)))
    assert af.signed_distance(v, f, np.zeros((0, 3))).shape == (0,)
    assert np.allclose(af.signed_distance(v, f, [[0, 0, 0], [3, 0, 0]]), [-1.0, 2.0], rtol=1e-15)
    far = af.signed_distance(v, f, [[1e30, 0, 0], [0, -1e12, 0]])
    assert np.allclose(far, [1e30, 1e12 - 1], rtol=1e-15)


def test_a_mesh_without_extent_has_distances():
    assert af.signed_distance([[1, 2, 3]], [[0, 0, 0]], [[1, 2, 5]]).tolist() == [2.0]


def test_a_cancelled_task_stops_the_call():
    task = af.Task()
    v, f = meshes.sphere()
    af.signed_distance(v, f, v, task=task)
    assert task.progress == 1.0
    task.cancel()
    with pytest.raises(af.Cancelled):
        af.signed_distance(v, f, v, task=task)


BOX = meshes.box()


@pytest.mark.parametrize(
    ("change", "argument", "says"),
    [
        ({"vertices": np.zeros((0, 3))}, "vertices", "none"),
        ({"vertices": np.where(np.arange(24).reshape(8, 3) == 10, np.nan, BOX[0])}, "vertices", "vertex 3"),
        ({"vertices": np.where(np.arange(24).reshape(8, 3) >= 15, np.inf, BOX[0])}, "vertices", "vertex 5"),
        ({"vertices": 1.7e308 * BOX[0]}, "vertices", "too large"),
        ({"vertices": BOX[0][:, :2]}, "vertices", "(8, 2)"),
        ({"vertices": BOX[0].astype(str)}, "vertices", "dtype"),
        ({"triangles": np.zeros((0, 3), int)}, "triangles", "none"),
        ({"triangles": np.where(np.arange(36).reshape(12, 3) == 16, 8, BOX[1])}, "triangles", "triangle 5"),
        ({"triangles": np.where(np.arange(36).reshape(12, 3) == 4, -1, BOX[1])}, "triangles", "vertex -1"),
        ({"triangles": BOX[1].astype(float)}, "triangles", "float64"),
        ({"triangles": BOX[1].ravel()}, "triangles", "(36,)"),
        ({"triangles": BOX[1] + 2**40}, "triangles", "too large"),
        ({"points": [[0, 0, 0], [0, np.nan, 0]]}, "points", "point 1"),
        ({"points": [[1e300, 0, 0]]}, "points", "too far"),
        ({"points": np.zeros(3)}, "points", "(3,)"),
        ({"threads": -1}, "threads", "-1"),
    ],
)
def test_bad_input_is_named(change, argument, says):
    arguments = {"vertices": BOX[0], "triangles": BOX[1], "points": [[0.0, 0, 0]]} | change
    for function in (af.signed_distance, af.winding_number):
        with pytest.raises(af.InvalidInput, match=f"^{argument}: ") as error:
            function(**arguments)
        assert says in str(error.value)
