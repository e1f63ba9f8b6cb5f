# SPDX-License-Identifier: GPL-3.0-or-later
"""Signed distances and winding numbers, at points and on grids."""

import igl
import numpy as np
import pytest
from support import tolerances
from support.geometry import meshes
from support.geometry.meshes import sphere

import arapfields as af
from arapfields import grids

# Signed distances and winding numbers against libigl, and what they must not depend on.


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


# Signed distances on grids, in memory and as files.


class Ball:
    """The exact distance of a sphere around (1, 2, 3)."""

    radius = 0.8
    frame = af.Frame([1.0, 2.0, 3.0], 1.5)

    def __call__(self, points):
        return np.linalg.norm(points - self.frame.center, axis=1) - self.radius


def nodes(values, origin, spacing):
    return origin + spacing * np.moveaxis(np.indices(values.shape), 0, -1)


@pytest.mark.parametrize("bounds", [None, [[0.0, 1.0, 2.5], [2.0, 3.0, 3.2]]])
def test_values_lie_where_origin_and_spacing_say(bounds):
    ball = Ball()
    values, origin, spacing = af.sdf_grid(ball, 20, bounds=bounds)
    expected = ball(nodes(values, origin, spacing).reshape(-1, 3)).reshape(values.shape)
    assert values.dtype == np.float32 and np.abs(values - expected).max() < 1e-6
    low, high = np.array(bounds) if bounds else ball.frame.to_mesh([[-1.0] * 3, [1.0] * 3])
    assert np.array_equal(origin, low)
    last = origin + spacing * (np.array(values.shape) - 1)
    assert (last >= high - 1e-9).all() and (last < high + spacing).all()
    assert max(values.shape) == 21


def test_mesh_distance_has_the_frame_of_its_samples():
    vertices, triangles = sphere(2.0, 2)
    vertices = np.vstack(
        [vertices + np.array([3.0, 0, 0]), [[100.0, 0, 0]]]
    )  # the last one is in no triangle
    distance = af.MeshSdf(vertices, triangles)
    assert distance.frame == af.sample_mesh(vertices, triangles, 10).frame
    assert distance([[3.0, 0, 0]])[0] < -1.8


def test_npz(tmp_path):
    grid = af.sdf_grid(Ball(), 8)
    af.save_grid(tmp_path / "grid.npz", *grid)
    with np.load(tmp_path / "grid.npz") as read:
        assert np.array_equal(read["values"], grid[0])
        assert np.array_equal(read["origin"], grid[1]) and read["spacing"] == grid[2]


def test_vdb_is_a_level_set_at_its_place(tmp_path):
    try:
        openvdb = grids.openvdb_module()
    except ImportError:
        pytest.skip("no openvdb module")
    values, origin, spacing = af.sdf_grid(Ball(), 24)
    af.save_grid(tmp_path / "grid.vdb", values, origin, spacing)
    grid = openvdb.read(str(tmp_path / "grid.vdb"), "surface")
    assert grid.gridClass == openvdb.GridClass.LEVEL_SET
    assert grid.transform.indexToWorld((1, 2, 3)) == pytest.approx(origin + spacing * np.array([1, 2, 3]))
    read = np.empty(values.shape, np.float32)
    grid.copyToArray(read)
    band = np.float32(grids.BAND * spacing)
    assert np.array_equal(read, np.clip(values, -band, band))


def test_vdb_without_openvdb_names_the_package(tmp_path, monkeypatch):
    monkeypatch.setitem(grids.sys.modules, "openvdb", None)
    monkeypatch.setattr(grids.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match="openvdb"):
        af.save_grid(tmp_path / "grid.vdb", *af.sdf_grid(Ball(), 4))
    assert not list(tmp_path.iterdir())


def test_bad_input_of_a_grid_is_named(tmp_path):
    for resolution in (0, 1.5, "8", grids.RESOLUTION["high"] + 1):
        with pytest.raises(af.InvalidInput, match="resolution"):
            af.sdf_grid(Ball(), resolution)
    odd = [[0, 0, 0]], [[0, 0, 0], [1, 0, 1]], [[0, 0, 0], [1, 1, np.nan]], "box", [[0], [1, 1]], 7
    for bounds in (*odd, np.ones((2, 3), complex), np.broadcast_to(np.zeros(3), (2_000_000_000, 3))):
        with pytest.raises(af.InvalidInput, match="bounds"):
            af.sdf_grid(Ball(), 4, bounds=bounds)
    for far in (np.nan, np.inf, 1e200):
        ball = Ball()
        ball.radius = far
        with pytest.raises(af.InvalidInput, match="sdf: a distance is NaN, infinite or beyond single"):
            af.sdf_grid(ball, 4)
    with pytest.raises(af.InvalidInput, match="extension"):
        af.save_grid(tmp_path / "grid.txt", *af.sdf_grid(Ball(), 4))
    grid = dict(zip(("values", "origin", "spacing"), af.sdf_grid(Ball(), 4), strict=True))
    for name in grid:
        with pytest.raises(af.InvalidInput, match=name):
            af.save_grid(tmp_path / "grid.npz", **{**grid, name: np.ones((3, 3, 3), object)})
    assert not list(tmp_path.iterdir())


def test_cancel():
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        af.sdf_grid(Ball(), 8, task=task)


@pytest.mark.parametrize("suffix", [".npz", ".vdb"])
def test_bad_grids_are_not_written(tmp_path, suffix):
    values, origin, spacing = af.sdf_grid(Ball(), 4)
    bad = [
        ("values", (values * np.nan, origin, spacing)),
        ("values", (values[0], origin, spacing)),
        ("values", (values[:0], origin, spacing)),
        ("values", (values.astype(str), origin, spacing)),
        ("values", (values.astype("datetime64[s]"), origin, spacing)),
        ("origin", (values, origin[:2], spacing)),
        ("origin", (values, [0, 0, np.inf], spacing)),
        ("spacing", (values, origin, "wide")),
        ("spacing", (values, origin, 0.0)),
        ("spacing", (values, origin, [1, 2])),
    ]
    for name, grid in bad:
        with pytest.raises(af.InvalidInput, match=name):
            af.save_grid(tmp_path / f"grid{suffix}", *grid)
    assert not list(tmp_path.iterdir())
