# SPDX-License-Identifier: GPL-3.0-or-later
"""Inverses: trained networks, Newton's on published shapes, and the cycle loss beside a deformation."""

import threading
import time

import numpy as np
import pytest
from support import tolerances
from support.geometry import cases
from support.oracles.network import Network

import arapfields as af


@pytest.fixture(scope="module")
def samples():
    return cases.bar_samples()


@pytest.fixture(scope="module")
def bent(samples):
    options = af.DeformOptions(width=32, layers=3, iterations=80, batch=100, handle_batch=50)
    return af.deform(samples, cases.bar_handles(), options)


def test_a_trained_inverse_returns(bent, samples):
    inverse = af.train_inverse(
        bent, samples, af.InverseTrainingOptions(width=64, layers=3, iterations=300, batch=300)
    )
    others = cases.bar_samples(500, seed=9).points
    error = np.linalg.norm(inverse(bent(others)) - others, axis=1)
    moved = np.linalg.norm(bent(others) - others, axis=1)
    assert np.quantile(error, 0.95) < 0.02 * moved.max()
    assert inverse.report.error_mean == pytest.approx(error.mean(), rel=0.2)


def test_what_is_infinitely_far_has_no_preimage(bent):
    """Squares of such distances overflow."""
    assert np.isnan(bent.inverse(np.array([[1e300, 0.0, 0.0]]))).all()


def test_a_trained_inverse_is_a_field_with_a_file(bent, samples, tmp_path):
    inverse = af.train_inverse(
        bent, samples, af.InverseTrainingOptions(width=16, layers=2, iterations=5, batch=50)
    )
    inverse.save(tmp_path / "inverse.safetensors")
    again = af.DeformationField.load(tmp_path / "inverse.safetensors")
    assert np.array_equal(again(samples.points), inverse(samples.points))
    assert inverse.frame == bent.frame


def test_bad_options_are_named(bent, samples):
    with pytest.raises(af.InvalidInput, match="batch"):
        af.train_inverse(bent, samples, af.InverseTrainingOptions(batch=0))
    with pytest.raises(af.InvalidInput, match="device"):
        af.train_inverse(bent, samples, af.InverseTrainingOptions(device="abacus"))


def test_invertibility_penalises_folds(samples):
    """A strong push, which folds the bar unless an inverse must keep up."""
    left, right = (h.rest for h in cases.bar_handles())
    handles = [cases.moved(left), cases.moved(right, cases.shift([-1.0, 0.0, 0.0]))]
    settings = dict(width=32, layers=3, iterations=250, batch=100, handle_batch=50, bending=0.0)
    settings |= dict(optimizer="adam", learning_rate=5e-3)
    free = af.deform(samples, handles, af.DeformOptions(**settings)).report
    kept = af.deform(samples, handles, af.DeformOptions(invertibility=100.0, **settings)).report
    assert free["min_determinant"] < 0.0
    assert kept["min_determinant"] > free["min_determinant"]
    assert kept["flipped_share"] < free["flipped_share"]


@pytest.mark.parametrize("kind", ["radial", "neural"])
@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e4])
def test_newtons_inverse_in_any_unit(unit, kind):
    """The same bar in other units of length and off the origin: all points come back, as exactly."""
    small = cases.bar_samples(400)
    frame = af.Frame([3.0 * unit, -unit, 2.0 * unit], unit)
    samples = af.SurfaceSamples(frame.to_mesh(small.points), small.normals, frame=frame)
    place = cases.shift(frame.center) @ np.diag([unit, unit, unit, 1.0])
    handles = [af.Cuboid(place @ h.rest, place @ h.target) for h in cases.bar_handles()]
    settings = dict(width=32, layers=3, iterations=60, batch=100, handle_batch=50)
    field = af.deform(samples, handles, af.DeformOptions(field=kind, **settings))
    error = np.linalg.norm(field.inverse(field(samples.points)) - samples.points, axis=1) / unit
    assert not np.isnan(error).any()
    assert np.quantile(error, 0.95) < tolerances.NEWTON_INVERSE


def gap_in_voxels(sdf, field, resolution, **keywords):
    """Symmetric Hausdorff distance, at vertices, of extract_deformed and the warped extraction."""
    mesh = af.extract_deformed(sdf, field, resolution, **keywords)
    (V, F), report = mesh, mesh.report
    rest, G = af.extract_surface(sdf, resolution)
    W = field(rest)
    apart = max(np.abs(af.signed_distance(W, G, V)).max(), np.abs(af.signed_distance(V, F, W)).max())
    return apart / report.spacing, report


@pytest.fixture(scope="module")
def bunny(data_dir):
    """The published bunny, bent by a radial field until an ear runs into the back."""
    path = data_dir / "neural_sdf" / "bunny.pt"
    sdf = af.NeuralSdf.from_layers(*Network.published(path).layers)
    samples = af.sample_surface(sdf, count=2000)
    return sdf, af.deform(samples, cases.bunny_handles(), af.DeformOptions(field="radial", locality=0))


def test_extraction_through_newtons_inverse(bunny):
    sdf, field = bunny
    apart, report = gap_in_voxels(sdf, field, 40)
    assert apart <= 1.5
    assert report.failures < 0.05 * report.inverted and not report.open
    assert report.inverted < report.dense_evaluations / 2


def test_extraction_stops_and_names_bad_input(bunny):
    sdf, field = bunny
    with pytest.raises(af.InvalidInput, match="resolution"):
        af.extract_deformed(sdf, field, 5)
    with pytest.raises(af.InvalidInput, match="threads"):
        af.extract_deformed(sdf, field, 32, threads=-1)
    task, seen = af.Task(), []

    def watch():
        while task.progress < 0.2:
            seen.append(task.progress)
            time.sleep(0.01)
        task.cancel()

    watcher = threading.Thread(target=watch)
    watcher.start()
    with pytest.raises(af.Cancelled):
        af.extract_deformed(sdf, field, 96, task=task)
    watcher.join()
    assert seen == sorted(seen)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bunny", "spot", "whale"])
def test_inverses_on_published_shapes(data_dir, name):
    """A bend by 40 degrees; Newton's inverse and a trained one, at uniform points and in extraction."""
    samples = cases.published_samples(data_dir / "neural_sdf" / f"{name}.pt")
    low, high = samples.points.min(0) - 0.01, samples.points.max(0) + 0.01
    axis = int(np.argmax(high - low))
    ends = []
    for begin, end in ((0.0, 0.3), (0.7, 1.0)):
        a, b = low.copy(), high.copy()
        a[axis], b[axis] = low[axis] + np.array([begin, end]) * (high - low)[axis]
        ends.append(cases.box(a, b))
    bend = cases.turn(np.eye(3)[(axis + 1) % 3], 40, (low + high) / 2)
    handles = [cases.moved(ends[0]), cases.moved(ends[1], bend)]
    field = af.deform(samples, handles, af.DeformOptions(iterations=100, locality=0))
    points = cases.published_samples(data_dir / "neural_sdf" / f"{name}.pt", 5000, seed=1).points
    images = field(points)
    error = np.linalg.norm(field.inverse(images) - points, axis=1)
    assert np.isnan(error).mean() <= 0.01
    assert np.nanquantile(error, 0.95) < tolerances.NEWTON_INVERSE
    sdf = af.NeuralSdf.from_layers(*Network.published(data_dir / "neural_sdf" / f"{name}.pt").layers)
    apart, report = gap_in_voxels(sdf, field, 128)
    assert apart <= 1.5 and report.failures <= 0.01 * report.inverted
    trained = af.train_inverse(field, samples, af.InverseTrainingOptions(iterations=1500))
    assert gap_in_voxels(sdf, field, 128, inverse=trained)[0] <= 1.5
    assert np.quantile(np.linalg.norm(trained(images) - points, axis=1), 0.95) < 1e-3


class Turtle(af.ImplicitFunction):
    """A flat shell with thin flippers, a head and a tail: ellipsoids (center, radii)."""

    PARTS = np.array(
        [[[0, 0, 0], [0.7, 0.5, 0.22]]]
        + [[[0.85, 0, 0.02], [0.2, 0.12, 0.1]], [[-0.8, 0, 0], [0.2, 0.04, 0.03]]]
        + [[[x, y, -0.05], [0.16, abs(y) / 2, 0.035]] for x in (0.45, -0.55) for y in (0.6, -0.6)]
    )

    def __init__(self):
        super().__init__(af.Frame([0, 0, 0], 1.3))

    def __call__(self, points):
        away = (points[:, None] - self.PARTS[:, 0]) / self.PARTS[:, 1]
        return ((np.linalg.norm(away, axis=2) - 1) * self.PARTS[:, 1].min(axis=1)).min(axis=1)


@pytest.mark.parametrize("style", ["octahedron", "dodecahedron"])
def test_every_point_of_a_styled_turtle_comes_back(style):
    """Where thin parts lie close together, the nearest image is not of the nearest part."""
    rest, triangles = af.extract_surface(Turtle(), 72)
    samples = af.sample_mesh(rest, triangles, 1200)
    field = af.stylize(samples, style, af.StylizeOptions(field="radial", strength=0.3))
    images = field(rest)
    found = field.inverse(images)
    assert not np.isnan(found).any()
    assert np.abs(field(found) - images).max() < 1e-5
