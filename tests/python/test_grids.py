# SPDX-License-Identifier: GPL-3.0-or-later
"""Signed distances on grids, in memory and as files."""

import numpy as np
import pytest
from support.geometry.meshes import sphere

import arapfields as af
from arapfields import grids


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


def test_vdb_without_openvdb_says_what_is_needed(tmp_path, monkeypatch):
    monkeypatch.setitem(grids.sys.modules, "openvdb", None)
    monkeypatch.setattr(grids.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match="openvdb"):
        af.save_grid(tmp_path / "grid.vdb", *af.sdf_grid(Ball(), 4))
    assert not list(tmp_path.iterdir())


def test_bad_input_is_named(tmp_path):
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
def test_what_is_no_grid_is_not_written(tmp_path, suffix):
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
