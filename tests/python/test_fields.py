# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields as Python sees them: derivatives against differences, exact handles, inverse, files."""

import numpy as np
import pytest
from support import tolerances
from support.geometry import cases

import arapfields as af


@pytest.fixture(scope="module")
def samples():
    return cases.bar_samples()


QUICK = dict(width=32, layers=3, iterations=60, batch=100, handle_batch=50)


@pytest.fixture(scope="module")
def bent(samples):
    return af.deform(samples, cases.bar_handles(), af.DeformOptions(**QUICK))


@pytest.fixture(scope="module")
def exact(samples):
    return af.deform(samples, cases.bar_handles(), af.DeformOptions(exact_handles=True, **QUICK))


@pytest.fixture(scope="module")
def refined(samples):
    """A network on a radial field, between exact handles."""
    options = af.DeformOptions(start="radial", centers=60, exact_handles=True, **QUICK)
    return af.deform(samples, cases.bar_handles(), options)


@pytest.fixture(scope="module")
def wrapped(samples):
    """A flow: maps one after the other."""
    onto = af.MeshSdf(
        samples.points * [1.2, 1.1, 0.9], np.arange(len(samples.points) - 2)[:, None] + [0, 1, 2]
    )
    return af.wrap(samples, onto, options=af.WrapOptions(centers=40, stages=3, iterations=2))


def differences(function, points, step=2e-3):
    """Central differences of fourth order, the new axis last."""
    columns = []
    for k in range(3):
        h = step * np.eye(3)[k]
        near = function(points + h) - function(points - h)
        far = function(points + 2 * h) - function(points - 2 * h)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, -1)


@pytest.mark.parametrize("kind", ["bent", "exact", "refined", "wrapped"])
def test_derivatives_against_differences(kind, samples, request):
    field = request.getfixturevalue(kind)
    points = samples.points[:40] * 0.97
    jacobian, hessian = field.jacobian(points), field.hessian(points)
    assert np.abs(jacobian - differences(field, points)).max() < tolerances.FLOAT_FIELD_DIFFERENCES
    error = np.abs(hessian - differences(field.jacobian, points)).max()
    assert error < tolerances.FLOAT_FIELD_DIFFERENCES * max(1.0, np.abs(hessian).max())
    assert np.allclose(hessian, hessian.transpose(0, 1, 3, 2), atol=1e-6)


def test_derivatives_in_mesh_coordinates():
    """The same problem ten times as large and shifted: same J, a tenth of H."""
    small = cases.bar_samples(400)
    frame = af.Frame([5.0, -3.0, 2.0], 10.0)
    large = af.SurfaceSamples(frame.to_mesh(small.points), small.normals, frame=frame)
    place = cases.shift(frame.center) @ np.diag([10.0, 10.0, 10.0, 1.0])
    handles = [af.Cuboid(place @ h.rest, place @ h.target) for h in cases.bar_handles()]
    options = af.DeformOptions(**QUICK)
    a, b = af.deform(small, cases.bar_handles(), options), af.deform(large, handles, options)
    x = small.points[:20]
    y = frame.to_mesh(x)
    assert np.allclose(frame.to_cube(b(y)), a(x), atol=1e-6)
    assert np.allclose(b.jacobian(y), a.jacobian(x), atol=1e-5)
    assert np.allclose(b.hessian(y) * 10, a.hessian(x), atol=1e-4)
    assert np.allclose(b.inverse(b(y)), y, atol=1e-4)
    assert b.report.handle_error_max == pytest.approx(10 * a.report.handle_error_max, rel=1e-4)


def test_inverse_returns_to_the_start(bent, samples):
    points = samples.points * 0.99
    back = bent.inverse(bent(points))
    error = np.linalg.norm(back - points, axis=1)
    assert not np.isnan(error).any()
    assert np.quantile(error, 0.95) < tolerances.NEWTON_INVERSE


def test_inverse_reports_points_without_a_preimage(bent):
    back = bent.inverse([[np.inf, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert np.isnan(back[:2]).all()
    assert np.allclose(bent(back[2:]), 0.0, atol=2e-6)
    unreachable = bent.inverse(np.full((1, 3), 0.3), tolerance=1e-30)
    assert np.isnan(unreachable).all()


@pytest.mark.parametrize("kind", ["bent", "exact", "refined"])
def test_files_round_trip(kind, request, tmp_path, samples):
    field = request.getfixturevalue(kind)
    field.save(tmp_path / "field.safetensors")
    again = af.DeformationField.load(tmp_path / "field.safetensors")
    points = samples.points[:100]
    assert np.array_equal(again(points), field(points))
    assert np.array_equal(again.hessian(points), field.hessian(points))
    assert np.array_equal(again.inverse(points), field.inverse(points), equal_nan=True)
    assert again.report == field.report and again.frame == field.frame


def test_bad_points_are_named(bent):
    with pytest.raises(af.InvalidInput, match="points"):
        bent([[0.0, 1.0]])
    with pytest.raises(af.InvalidInput, match=r"points.*finite"):
        bent([[0.0, 1.0, np.nan]])
    assert bent(np.zeros((0, 3))).shape == (0, 3)
    assert bent.hessian(np.zeros((0, 3))).shape == (0, 3, 3, 3)


def test_distortion_at_points(bent, samples):
    points = samples.points[:300]
    measured = af.distortion(bent, points)
    stretches = np.linalg.svd(bent.jacobian(points), compute_uv=False)
    determinants = np.linalg.det(bent.jacobian(points))
    assert measured.min_determinant == pytest.approx(determinants.min(), rel=1e-6)
    assert measured.flipped_share == (determinants <= 0).mean()
    assert measured.max_stretch == pytest.approx(stretches.max(), rel=1e-6)
    assert measured.min_stretch == pytest.approx(stretches.min(), rel=1e-6)
    with pytest.raises(af.InvalidInput, match=r"samples|points"):
        af.distortion(bent, np.zeros((0, 3)))
