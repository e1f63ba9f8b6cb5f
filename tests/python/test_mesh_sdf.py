# SPDX-License-Identifier: GPL-3.0-or-later
"""MeshSdf, the exact signed distance as an implicit function: extracted, sampled, deformed without a fit."""

import numpy as np
import pytest
from support import tolerances
from support.geometry import cases, meshes
from support.geometry.meshes import check_closed

import arapfields as af


def joined(*parts):
    """One soup of several meshes."""
    offsets = np.cumsum([0, *(len(V) for V, _ in parts)])
    F = np.concatenate([F + offset for (_, F), offset in zip(parts, offsets, strict=False)])
    return np.concatenate([V for V, _ in parts]), F


def moved(mesh, offset):
    return mesh[0] + np.asarray(offset, float), mesh[1]


def bowl():
    """The lower half of a sphere, open at the top."""
    V, F = meshes.sphere(1.0, 4)
    return V, F[V[F, 2].max(1) < 0.05]


SHAPES = {
    "torus": lambda: meshes.torus(),
    "plate": lambda: meshes.box((1.0, 0.7, 0.025)),
    "overlapping": lambda: joined(
        meshes.sphere(1.0, 3), moved(meshes.sphere(0.7, 3), [0.8, 0.1, 0]), meshes.box((1.5, 0.2, 0.2))
    ),
}


def dense_crossings(V, F, n):
    """Where the whole grid's edges cross the surface, in mesh coordinates."""
    frame = af.MeshSdf(V, F).frame
    t = np.linspace(-1, 1, n)
    grid = np.stack(np.meshgrid(t, t, t, indexing="ij"), -1).reshape(-1, 3)
    values = af.signed_distance(V, F, frame.to_mesh(grid.astype(np.float32)))
    grid, values = grid.reshape(n, n, n, 3), (values / frame.scale).astype(np.float32).reshape(n, n, n)
    results = []
    for axis in range(3):
        low, high = (np.take(values, range(a, n - 1 + a), axis).astype(float) for a in (0, 1))
        x, y = (np.take(grid, range(a, n - 1 + a), axis) for a in (0, 1))
        crossed = (low < 0) != (high < 0)
        share = (low[crossed] / (low[crossed] - high[crossed]))[:, None]
        results.append(x[crossed] + share * (y[crossed] - x[crossed]))
    return frame.to_mesh(np.concatenate(results))


@pytest.mark.parametrize("n", [33, 64, 96])
@pytest.mark.parametrize("shape", SHAPES)
def test_extraction_has_every_vertex_of_the_whole_grid(shape, n):
    spatial = pytest.importorskip("scipy.spatial")
    V, F = SHAPES[shape]()
    expected = dense_crossings(V, F, n)
    extraction = af.extract_surface(af.MeshSdf(V, F), n)
    (vertices, triangles), report = extraction, extraction.report
    assert len(vertices) >= len(expected)  # and those within cells
    assert spatial.cKDTree(vertices).query(expected)[0].max() < tolerances.SAME_VERTICES
    check_closed(vertices, triangles)
    assert report.evaluations < 0.4 * n**3 and not report.open


def test_values_and_gradients():
    V, F = SHAPES["overlapping"]()
    sdf = af.MeshSdf(V * 50, F)  # millimetres
    points = np.random.default_rng(0).uniform(-120, 120, (500, 3))
    assert np.array_equal(sdf(points), af.signed_distance(V * 50, F, points))
    steps = 1e-4 * np.eye(3)
    differences = np.stack([(sdf(points + s) - sdf(points - s)) / 2e-4 for s in steps], -1)
    smooth = np.abs(np.linalg.norm(differences, axis=1) - 1.0) < 1e-6  # not beside a crease
    assert smooth.mean() > 0.99
    gradients = sdf.gradient(points)
    assert np.abs(gradients - differences)[smooth].max() < 1e-6
    assert np.allclose(np.linalg.norm(gradients, axis=1), 1.0)
    corners = V[F] * 50
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inner = corners.mean(1)[:100]
    assert np.einsum("ij,ij->i", sdf.gradient(inner), normals[:100]).min() > 0.999
    assert sdf.closed and np.isclose(sdf.frame.scale, 50 * af.MeshSdf(V, F).frame.scale)


def test_samples_are_uniform_on_the_outer_surface():
    half = np.array([0.9, 0.6, 0.3])
    V, F = joined(meshes.box(half), moved(meshes.sphere(0.2, 2), [0.1, 0, 0]))  # the ball is hidden
    sdf = af.MeshSdf(V, F)
    samples = af.sample_surface(sdf, 20000, seed=2)
    assert np.abs(sdf(samples.points)).max() <= tolerances.ON_SURFACE
    axis = np.argmin(np.abs(np.abs(samples.points) - half), axis=1)
    rows = np.arange(len(axis))
    side = samples.points[rows, axis] > 0
    assert (np.einsum("ij,ij->i", samples.normals, np.eye(3)[axis]) * np.where(side, 1, -1)).min() > 0.999
    others = np.array([[1, 2], [2, 0], [0, 1]])[axis]
    uv = np.take_along_axis(samples.points / half, others, 1)
    cells = np.clip(((uv + 1) * 2).astype(int), 0, 3)
    bins = np.bincount(((axis * 2 + side) * 4 + cells[:, 0]) * 4 + cells[:, 1], minlength=96)
    areas = np.repeat([half[1] * half[2], half[2] * half[0], half[0] * half[1]], 32)
    expected = len(axis) * areas / areas.sum()
    chi = ((bins - expected) ** 2 / expected).sum()
    assert (chi - 95) / np.sqrt(2 * 95) < 3.1  # the one-sided 0.1 % point; the seed is fixed


def test_deformed_like_the_triangles_themselves():
    V, F = meshes.subdivide(*meshes.subdivide(*meshes.box((0.8, 0.15, 0.15))))
    sdf = af.MeshSdf(V, F)
    options = af.DeformOptions(field="radial", iterations=60)
    ours, theirs = (
        af.deform(samples, cases.bar_handles(), options)
        for samples in (af.sample_surface(sdf, 4000), af.sample_mesh(V, F, 4000))
    )
    motion = np.linalg.norm(theirs(V) - V, axis=1).max()
    assert np.linalg.norm(ours(V) - theirs(V), axis=1).max() < 0.02 * motion
    extraction = af.extract_deformed(sdf, ours, 48)
    (after, triangles), report = extraction, extraction.report
    check_closed(after, triangles)
    assert np.abs(af.signed_distance(ours(V), F, after)).max() < 1.5 * report.spacing
    styled = af.stylize(
        af.sample_surface(sdf, 2000), "cube", af.StylizeOptions(iterations=5, width=16, layers=2)
    )
    assert np.isfinite(styled(V)).all()


def test_holes_stay_open_and_cracks_close():
    V, F = bowl()
    sdf = af.MeshSdf(V, F)
    assert not sdf.closed
    (after, _), report = (extraction := af.extract_surface(sdf, 64)), extraction.report
    step = 2.0 * sdf.frame.scale / 63
    assert np.abs(sdf(after)).max() <= 0.5 * step * 1.001 and report.open
    samples = af.sample_surface(sdf, 3000)
    assert np.abs(sdf(samples.points)).max() <= tolerances.ON_SURFACE * sdf.frame.scale
    whole, G = meshes.sphere(1.0, 4)  # a triangle is much smaller than a cell of 16 a side
    af_sdf = af.MeshSdf(whole, G[1:])
    check_closed(*af.extract_surface(af_sdf, 16))
    assert not af_sdf.closed


def test_an_open_mesh_is_deformed_open():
    V, F = bowl()
    sdf = af.MeshSdf(V, F)
    rest = cases.box([-2, -2, -2], [2, 2, -0.8])
    rim = cases.box([0.7, -2, -0.3], [2, 2, 0.3])
    handles = [cases.moved(rest), cases.moved(rim, cases.shift([0.2, 0, 0.1]))]
    field = af.deform(af.sample_surface(sdf, 3000), handles, af.DeformOptions(field="radial", iterations=40))
    (after, _), report = (extraction := af.extract_deformed(sdf, field, 48)), extraction.report
    distance = np.abs(af.signed_distance(field(V), F, after))
    assert report.open and distance.max() < 1.5 * report.spacing


def test_bad_input_is_named():
    V, F = meshes.sphere(1.0, 1)
    with pytest.raises(af.InvalidInput, match="triangles"):
        af.MeshSdf(V, F + 1000)
    with pytest.raises(af.InvalidInput, match="points"):
        af.MeshSdf(V, F)([[np.nan, 0, 0]])
    with pytest.raises(af.InvalidInput, match=r"save.*fit_sdf"):
        af.MeshSdf(V, F).save("somewhere")
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        af.extract_surface(af.MeshSdf(V, F), 64, task=task)
