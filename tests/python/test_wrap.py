# SPDX-License-Identifier: GPL-3.0-or-later
"""One surface wrapped onto another: found again, partly there, refused; small shapes."""

import numpy as np
import pytest
from support.geometry import wrap_cases as cases

import arapfields as af

# Known fields are found again, in % of the target's diagonal: what the coarse triangles of the shapes leave.
FOUND_AGAIN = 0.5
# Mean distance from where a smooth map takes the vertices, in % of the target's diagonal: noise of
# correspondences adds a fifth.
ALONG_THE_SURFACE = 0.215


@pytest.mark.parametrize("landmarks", [0, 4])
def test_a_moved_scaled_and_bent_shape_is_found_again(figure, samples, landmarks):
    v, f = figure
    target_v = cases.moved(v)
    chosen = np.linspace(0, len(v) - 1, landmarks, dtype=int)
    options = af.WrapOptions(**cases.SMALL)
    field = af.wrap(samples, af.MeshSdf(target_v, f), [(v[i], target_v[i]) for i in chosen], options)
    (mean, _), (back, _) = cases.distances(field(v), f, target_v, f, 2000)
    assert max(mean, back) < FOUND_AGAIN
    report = field.report
    assert report.flipped_share == 0 and report.matched_share == 1 and not report.notes
    assert abs(report.scale - 3) < 0.2 and len(report.landmarks) == landmarks
    assert abs(report.diagonal / np.linalg.norm(np.ptp(target_v, axis=0)) - 1) < 0.02
    away = np.linalg.norm(field(v) - target_v, axis=1).mean() / report.diagonal
    assert away < 0.08  # its points too, nearly: nothing but rigidity keeps them from sliding along it


def test_places_follow_a_smooth_map_along_the_surface():
    v, f, places = cases.star()
    known = v * (1 + 0.25 * np.exp(-((v - [0.5, 0.3, 0.2]) ** 2).sum(1, keepdims=True) / 0.5))
    pairs = [(v[i], known[i]) for i in places]
    some = af.WrapOptions(centers=200)
    away = [
        np.linalg.norm(
            af.wrap(af.sample_mesh(v, f, 4000, seed=seed), af.MeshSdf(known, f), pairs, some)(v) - known,
            axis=1,
        ).mean()
        for seed in range(2)
    ]
    assert 100 * np.mean(away) / np.linalg.norm(np.ptp(known, axis=0)) < ALONG_THE_SURFACE


def test_shapes_that_are_not_alike_stay_upright():
    """A big head fits a big body a little better upside down."""
    little, big = cases.doll(0.35, 0.5), cases.doll(0.5, 0.45)
    field = af.wrap(af.sample_mesh(*little, 1500), af.MeshSdf(*big), [], af.WrapOptions(**cases.SMALL))
    assert (np.diag(field.jacobian([[0, 0, 0.4]])[0]) > 0).all()


@pytest.mark.parametrize("name", ["weights", "bend_weights"])
def test_what_weighs_more_resists_more(figure, samples, name):
    """The nose beside the rest of a shape that is to become a ball."""
    v, _ = figure
    nose = v[:, 0] > 1.0
    heavy = np.where(samples.points[:, 0] > 0.9, 300.0, 1.0)
    lengths = [
        np.ptp(af.wrap(each, af.MeshSdf(*cases.sphere(0.8, 3)), [], options)(v)[nose][:, 0])
        for options in [af.WrapOptions(alignment="none", **cases.SMALL)]
        for each in (samples, samples.with_weights(**{name: heavy}))
    ]
    assert lengths[1] > 1.1 * lengths[0]


def test_any_implicit_function_is_a_target(samples):
    class Ball(af.ImplicitFunction):
        def __call__(self, points):
            return np.linalg.norm(points, axis=1) - 0.6

    field = af.wrap(samples, Ball(), [], af.WrapOptions(alignment="similar", **cases.SMALL))
    places = field(samples.points)
    assert abs(np.linalg.norm(places, axis=1) - 0.6).mean() < 0.02
    assert any("not alike" in note for note in field.report.notes)


def test_what_the_target_lacks_is_drawn_in_without_passing_through_itself(figure, samples):
    """The nose and the hump of the shape have no counterpart on a ball."""
    ball = af.MeshSdf(*cases.sphere(0.8, 3))
    field = af.wrap(samples, ball, [], af.WrapOptions(alignment="none", centers=200))
    v, f = cases.figure(5)
    assert cases.crossing_share(field(v), f) == 0
    assert field.report.flipped_share == 0 and field.report.min_determinant > 0
    (mean, _), (back, _) = cases.distances(field(v), f, *cases.sphere(0.8, 4), 2000)
    assert max(mean, back) < FOUND_AGAIN
    assert np.abs(field.inverse(field(v[:500])) - v[:500]).max() < 1e-6


def test_what_an_open_target_lacks_keeps_its_shape(figure, samples):
    v, f = figure
    half = f[(v[f].mean(1)[:, 0] < 0.2)]
    grown = v * [1, 1.1, 1.1]
    options = af.WrapOptions(alignment="none", **cases.SMALL)
    field = af.wrap(samples, af.MeshSdf(grown, half), [], options)
    report = field.report
    assert 0.3 < report.matched_share < 0.8
    assert report.from_target_mean < 0.01
    nose = v[v[:, 0] > 1.0]
    after = field(nose)
    rest, now = nose - nose.mean(0), after - after.mean(0)
    turned = rest @ af.rigid_motion(rest, now)[:3, :3].T
    assert np.abs(turned - now).max() < 0.1 * np.abs(rest).max()


def test_no_alignment_leaves_the_surface_where_it_lies(figure, samples):
    v, f = figure
    field = af.wrap(samples, af.MeshSdf(v, f), [], af.WrapOptions(alignment="none", **cases.SMALL))
    assert np.linalg.norm(field(v) - v, axis=1).max() < 0.1 and field.report.scale == pytest.approx(1)


def test_a_field_is_saved_and_read(figure, samples, tmp_path):
    v, f = figure
    field = af.wrap(samples, af.MeshSdf(cases.moved(v), f), [], af.WrapOptions(**cases.SMALL))
    field.save(tmp_path / "wrap.safetensors")
    again = af.DeformationField.load(tmp_path / "wrap.safetensors")
    assert np.array_equal(again(v), field(v))


def test_targets_without_a_surface_are_named(samples):
    class Nothing(af.ImplicitFunction):
        def __call__(self, points):
            return np.ones(len(points))

    with pytest.raises(af.InvalidInput, match="target"):
        af.wrap(samples, Nothing(), [], af.WrapOptions(**cases.SMALL))
    with pytest.raises(af.InvalidInput, match="target"):
        af.wrap(samples, "scan.ply")
    with pytest.raises(af.InvalidInput, match="vertices"):
        af.MeshSdf(np.zeros((0, 3)), np.zeros((0, 3), int))


def test_coordinates_without_a_square_are_named(figure, samples):
    v, f = figure
    options = af.WrapOptions(**cases.SMALL)
    with pytest.raises(af.InvalidInput, match="target: its coordinates are too large"):
        af.wrap(samples, af.MeshSdf(1e200 * v, f), [], options)
    for pair in ([v[0], [1e200, 0, 0]], [[0, 1e200, 0], v[0]]):
        with pytest.raises(af.InvalidInput, match=r"landmarks\[0\]: a coordinate is .* too large"):
            af.wrap(samples, af.MeshSdf(v, f), [pair], options)


def test_cancel_and_progress(figure, samples):
    v, f = figure
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        af.wrap(samples, af.MeshSdf(v, f), task=task)
    task = af.Task()
    af.wrap(samples, af.MeshSdf(v, f), [], af.WrapOptions(**cases.SMALL), task=task)
    assert task.progress == 1


def test_the_number_of_threads_changes_nothing(figure, samples):
    v, f = figure
    target = af.MeshSdf(cases.moved(v), f)
    results = [af.wrap(samples, target, [], af.WrapOptions(threads=n, **cases.SMALL))(v) for n in (1, 2)]
    assert np.array_equal(*results)
