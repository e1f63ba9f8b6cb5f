# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples of implicit surfaces and of triangles."""

import numpy as np
import pytest
import scipy.spatial
from support.geometry import cases, meshes
from support.oracles import Network
from support.tolerances import ON_SURFACE

import arapfields as af

# sample_surface on a published network: uniform, on the surface, repeatable (shapes: native tests).

COUNT = 6000
CELLS = 6  # a side: 216 cells


@pytest.fixture(scope="module")
def bunny(data_dir):
    return af.NeuralSdf.from_layers(*Network.published(data_dir / "neural_sdf" / "bunny.pt").layers)


@pytest.fixture(scope="module")
def samples(bunny):
    return af.sample_surface(bunny, COUNT, seed=1)


def histogram(points):
    return np.histogramdd(points, bins=CELLS, range=[(-1, 1)] * 3)[0].ravel() / len(points)


def total_variation(a, b):
    return 0.5 * np.abs(histogram(a) - histogram(b)).sum()


def test_points_lie_on_the_surface_with_its_normals(bunny, samples):
    assert samples.points.shape == samples.normals.shape == (COUNT, 3)
    assert np.abs(bunny(samples.points)).max() <= ON_SURFACE
    gradients = bunny.gradient(samples.points[:500])
    cosine = np.einsum("ij,ij->i", gradients, samples.normals[:500]) / np.linalg.norm(gradients, axis=1)
    assert cosine.min() > 1 - 1e-5


def test_as_uniform_as_samples_by_area(bunny, samples):
    V, F = af.extract_surface(bunny, 128)
    by_area = [af.sample_mesh(V, F, COUNT, seed=seed).points for seed in range(6)]
    between = np.mean([total_variation(a, b) for a, b in zip(by_area[::2], by_area[1::2], strict=True)])
    ours = np.mean([total_variation(samples.points, other) for other in by_area])
    assert ours <= 1.3 * between


def test_seed_decides_and_report_is_filled(bunny):
    a = af.sample_surface(bunny, 500, seed=3)
    report = a.report
    assert np.array_equal(a.points, af.sample_surface(bunny, 500, seed=3).points)
    assert not np.array_equal(a.points, af.sample_surface(bunny, 500, seed=4).points)
    assert report.evaluations > report.gradient_evaluations >= 500
    assert report.largest_value <= ON_SURFACE


def test_bad_arguments_cancel_and_no_surface(bunny):
    with pytest.raises(af.InvalidInput, match="count"):
        af.sample_surface(bunny, 0)
    with pytest.raises(af.InvalidInput, match="threads"):
        af.sample_surface(bunny, 10, threads=-1)
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        af.sample_surface(bunny, 10, task=task)
    flat = [np.zeros((4, 24)), np.zeros((1, 4))]
    with pytest.raises(af.InvalidInput, match="one sign"):
        af.sample_surface(af.NeuralSdf.from_layers(flat, [np.zeros(4), np.ones(1)]), 10)


# Samples straight from triangles, and samples that a caller brings.

GYRATION = 0.6  # of a surface in its cube
TIP_SPACINGS = 6.0  # of a vertex from the nearest sample at most, in the samples' mean spacing; seen 5.6


def test_samples_lie_on_the_triangles_with_their_normals():
    v, f = meshes.torus()
    v = 3.0 * v + [10.0, 20.0, 30.0]
    samples = af.sample_mesh(v, f, count=3000, seed=1)
    assert len(samples) == 3000
    assert samples.points.shape == samples.normals.shape == (3000, 3)
    assert np.abs(af.signed_distance(v, f, samples.points)).max() < 1e-12
    assert np.allclose(np.linalg.norm(samples.normals, axis=1), 1)
    step = 1e-3
    assert (af.signed_distance(v, f, samples.points + step * samples.normals) > 0).all()
    assert (af.signed_distance(v, f, samples.points - step * samples.normals) < 0).all()


def gyration(half):
    """Radius of gyration of the surface of a box with these half-extents."""
    x, y, z = np.square(half)
    areas = np.array([half[1] * half[2], half[0] * half[2], half[0] * half[1]])
    squares = np.array([x + (y + z) / 3, y + (x + z) / 3, z + (x + y) / 3])
    return np.sqrt(areas @ squares / areas.sum())


def test_the_frame_is_the_area_s():
    """Its centroid and its radius of gyration, whatever vertices are not in use."""
    v, f = meshes.box((4.0, 2.0, 1.0))
    stray = np.concatenate([v + np.array([1.0, 2.0, 3.0]), [[1e3, 0, 0]]])
    samples = af.sample_mesh(stray, f, count=10)
    assert np.allclose(samples.frame.center, [1, 2, 3])
    assert np.isclose(samples.frame.scale, gyration((4.0, 2.0, 1.0)) / GYRATION)
    assert "10 points" in repr(samples)


def test_the_frame_turns_and_scales_with_the_mesh():
    v, f = meshes.box((4.0, 2.0, 1.0))
    v = v + np.array([5.0, 0, 0])
    motion = cases.turn([1, 2, 3], 37, (1.0, 0, 0))
    rest = af.sample_mesh(v, f, count=10).frame
    moved = af.sample_mesh(3e4 * (v @ motion[:3, :3].T + motion[:3, 3]), f, count=10).frame
    assert np.isclose(moved.scale, 3e4 * rest.scale, rtol=1e-9)
    assert np.allclose(moved.center, 3e4 * (motion[:3, :3] @ rest.center + motion[:3, 3]), rtol=1e-9)


def test_small_distant_parts_hardly_move_the_frame():
    """A thousandth of the length, a hundred lengths away: a part in ten thousand of the frame."""
    v, f = meshes.sphere()
    rest = af.sample_mesh(v, f, count=10).frame
    both = np.concatenate([v, 1e-3 * v + [100.0, 30.0, 0.0]])
    far = af.sample_mesh(both, np.concatenate([f, f + len(v)]), count=10).frame
    assert abs(far.scale / rest.scale - 1) < 1e-4
    assert np.linalg.norm(far.center - rest.center) < 1e-4 * rest.scale


def test_counts_follow_areas():
    """χ² over the faces of a box cut into cells: 11 degrees of freedom, mean 11, standard deviation 4.7."""
    v, f = meshes.box((1.0, 0.5, 0.25))
    count = 20000
    points = af.sample_mesh(v, f, count=count, seed=7).points / [1.0, 0.5, 0.25]
    face = np.argmax(np.abs(points), axis=1)
    side = np.take_along_axis(points, face[:, None], 1)[:, 0] > 0
    half = np.take_along_axis(points, ((face + 1) % 3)[:, None], 1)[:, 0] > 0
    observed = np.bincount(4 * face + 2 * side + half, minlength=12)
    areas = np.repeat([0.5 * 0.25, 1.0 * 0.25, 1.0 * 0.5], 4)
    expected = count * areas / areas.sum()
    assert ((observed - expected) ** 2 / expected).sum() < 11 + 6 * 4.7


def test_points_fill_a_triangle_evenly():
    """A triangle quartered: each quarter gets its share within six standard deviations."""
    v, f = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]]), np.array([[0, 1, 2]])
    points = af.sample_mesh(v, f, count=40000, seed=2).points
    s, t = points[:, 0], points[:, 1] / 2
    quarters = [s > 0.5, t > 0.5, s + t < 0.5]
    for quarter in quarters:
        assert abs(quarter.mean() - 0.25) < 6 * np.sqrt(0.25 * 0.75 / 40000)


def test_seeds_and_prefixes():
    v, f = meshes.sphere()
    first = af.sample_mesh(v, f, count=1000, seed=3)
    assert np.array_equal(first.points, af.sample_mesh(v, f, count=1000, seed=3).points)
    assert np.array_equal(first.points[:100], af.sample_mesh(v, f, count=100, seed=3).points)
    assert not np.array_equal(first.points, af.sample_mesh(v, f, count=1000, seed=4).points)


def test_triangles_without_area_are_never_drawn():
    v, f = meshes.box()
    flat = np.concatenate([np.repeat(f[:5, :1], 3, axis=1), f, f[:5][:, [0, 1, 1]]])
    assert np.allclose(np.linalg.norm(af.sample_mesh(v, flat, count=2000).normals, axis=1), 1)


def test_samples_from_arrays():
    rng = np.random.default_rng(0)
    points, normals = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    samples = af.SurfaceSamples(points, normals)
    assert np.allclose(samples.points, points)
    assert np.allclose(samples.normals, normals / np.linalg.norm(normals, axis=1, keepdims=True))
    assert np.allclose(samples.frame.center, points.mean(0))
    assert np.isclose(samples.frame.scale, np.sqrt(points.var(axis=0).sum()) / GYRATION)
    frame = af.Frame([1.0, 2.0, 3.0], 4.0)
    assert af.SurfaceSamples(points, normals, frame).frame == frame
    for bad in (np.zeros((0, 3)), points[:, :2], np.full((50, 3), np.nan), points[:49], "x"):
        with pytest.raises(af.InvalidInput, match=r"^(points|normals): "):
            af.SurfaceSamples(bad, normals)
    with pytest.raises(af.InvalidInput, match="normal 7"):
        af.SurfaceSamples(points, np.where(np.arange(50)[:, None] == 7, 0.0, normals))


@pytest.mark.parametrize(
    ("vertices", "triangles", "count", "argument"),
    [
        (np.zeros((3, 3)), [[0, 1, 2]], 10, "vertices"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], 10, "triangles"),
        (np.zeros((0, 3)), [[0, 1, 2]], 10, "vertices"),
        (np.eye(3), np.zeros((0, 3), int), 10, "triangles"),
        (np.eye(3), [[0, 1, 3]], 10, "triangles"),
        (np.full((3, 3), np.inf), [[0, 1, 2]], 10, "vertices"),
        (np.eye(3), [[0, 1, 2]], 0, "count"),
    ],
)
def test_bad_input_is_named(vertices, triangles, count, argument):
    with pytest.raises(af.InvalidInput, match=f"^{argument}: "):
        af.sample_mesh(vertices, triangles, count=count)


def test_more_points_than_memory_holds_are_refused():
    v, f = meshes.box()
    with pytest.raises(af.InvalidInput, match=r"count: this would take about .* GiB"):
        af.sample_mesh(v, f, count=10**12)


@pytest.mark.parametrize("count", [20000, 2000])
def test_tips_have_samples_near_them(count):
    """Needles of next to no area, and vertices pulled out into spikes."""
    v, f = meshes.sphere(subdivisions=4)
    tips = np.random.default_rng(3).choice(len(v), 20, replace=False)
    v[tips] *= 4.0
    needle, g = meshes.box((1.5, 1e-5, 1e-5))
    both, triangles = meshes.together((v, f), (needle + np.array([0, 0, 2.0]), g))
    samples = af.sample_mesh(both, triangles, count=count)
    corners = both[triangles]
    area = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    distances = scipy.spatial.cKDTree(samples.points).query(both)[0]
    assert distances.max() < TIP_SPACINGS * np.sqrt(area.sum() / count)
