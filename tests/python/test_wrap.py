# SPDX-License-Identifier: GPL-3.0-or-later
"""One surface wrapped onto another: found again, partly there, refused; small shapes."""

import numpy as np
import pytest
from support.geometry import wrap_cases as cases

import arapfields as af

# Known fields are found again, in % of the target's diagonal: what the coarse triangles of the shapes leave.
FOUND_AGAIN = 0.5


@pytest.fixture(scope="module")
def figure():
    return cases.figure(3)


@pytest.fixture(scope="module")
def samples(figure):
    return af.sample_mesh(*figure, 1500)


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


def test_landmarks_that_cannot_be_meant_are_named(figure, samples):
    v, f = figure
    sdf, options = af.MeshSdf(v, f), af.WrapOptions(**cases.SMALL)
    far = [1.0, 9.0, 0.0]
    for landmarks, named in (
        ([(v[0], v[0]), (far, v[1])], r"landmarks\[1\]: its place at rest"),
        ([(v[0], far)], r"landmarks\[0\]: its place on the target"),
        ([(v[0], [np.nan, 0, 0])], r"landmarks\[0\]"),
        ([(v[0], v[0]), (v[0], v[1])], r"landmarks\[0\] and landmarks\[1\].*one place at rest"),
        ([(v[0], v[0]), (v[1], v[0])], r"landmarks\[0\] and landmarks\[1\].*two places at rest"),
        ([(v[0],)], r"landmarks\[0\]"),
        ([v[0]], r"landmarks\[0\]"),
        (5, "landmarks"),
    ):
        with pytest.raises(af.InvalidInput, match=named):
            af.wrap(samples, sdf, landmarks, options)


def ends_of(v):
    """Vertices at ten ends of the figure."""
    up, aside = np.array([0, 0.6, 0.8]), np.array([0, 0.8, -0.6])
    ahead = np.array([1, 0, 0])
    ways = [ahead, -ahead, up, -up, aside, -aside, ahead - 2 * up, ahead + 2 * aside]
    ways += [-ahead - aside, up - ahead]
    return [int(np.argmax(v @ way)) for way in ways]


def test_a_mirror_image_is_refused(figure, samples):
    v, f = figure
    ends = v[ends_of(v)[:6]]
    exchanged = ends[[0, 1, 2, 3, 5, 4]]
    options = af.WrapOptions(centers=20, stages=1, iterations=1)
    with pytest.raises(af.InvalidInput, match="mirror image"):
        af.wrap(samples, af.MeshSdf(v, f), list(zip(ends, exchanged, strict=True)), options)


@pytest.mark.parametrize("wrong", [{0: 8}, {4: 5, 5: 4}, {2: 0, 4: 9}])
def test_landmarks_that_lie_are_named_and_left_out(figure, samples, wrong):
    v, f = figure
    target_v, ends = cases.moved(v), ends_of(v)
    pairs = [(v[end], target_v[ends[wrong.get(i, i)]]) for i, end in enumerate(ends[:8])]
    sdf, options = af.MeshSdf(target_v, f), af.WrapOptions(**cases.SMALL)
    field = af.wrap(samples, sdf, pairs, options)
    assert field.report.left_out == tuple(wrong)
    assert [note.split(" contradicts")[0] for note in field.report.notes] == [
        f"landmarks[{i}]" for i in wrong
    ]
    right = [pair for i, pair in enumerate(pairs) if i not in wrong]
    assert np.array_equal(field(v), af.wrap(samples, sdf, right, options)(v))


@pytest.mark.parametrize("seed", [2, 11, 24])
def test_a_landmark_that_lies_a_little_is_named_beside_one_that_lies_much(seed):
    """An eighth of the size off, on the same arm; the other one anywhere."""
    v, f, ends = cases.star()
    target_v, rng = cases.moved(v), np.random.default_rng(seed)
    little, much = rng.choice(len(ends), 2, replace=False)
    away = np.linalg.norm(target_v - target_v[ends[little]], axis=1) / np.linalg.norm(
        np.ptp(target_v, axis=0)
    )
    told = ends.copy()
    told[little] = rng.choice(np.flatnonzero((away > 0.11) & (away < 0.15)))
    told[much] = rng.integers(len(v))
    pairs = list(zip(v[ends], target_v[told], strict=True))
    options = af.WrapOptions(centers=20, stages=1, iterations=1)
    report = af.wrap(af.sample_mesh(v, f, 1500), af.MeshSdf(target_v, f), pairs, options).report
    assert report.left_out == tuple(sorted((little, much)))


@pytest.mark.parametrize(("liar", "told"), [(4, 251), (5, 200), (5, 30)])
def test_a_landmark_on_a_round_back_is_not_blamed_for_what_another_says(figure, samples, liar, told):
    v, f = figure
    target_v, ends = cases.moved(v), ends_of(v)[:8]
    pairs = [(v[end], target_v[told if i == liar else end]) for i, end in enumerate(ends)]
    options = af.WrapOptions(centers=20, stages=1, iterations=1)
    report = af.wrap(samples, af.MeshSdf(target_v, f), pairs, options).report
    assert set(report.left_out) <= {liar}


def test_landmarks_of_which_most_lie_are_not_followed_without_a_word(figure, samples):
    v, f = figure
    target_v, ends = cases.moved(v), ends_of(v)
    pairs = [(v[a], target_v[b]) for a, b in zip(ends, ends[3:] + ends[:3], strict=True)]
    options = af.WrapOptions(centers=20, stages=1, iterations=1)
    report = af.wrap(samples, af.MeshSdf(target_v, f), pairs, options).report
    assert not report.left_out and any("contradict each other" in note for note in report.notes)


def test_suggested_landmarks_are_ends_and_lie_where_they_belong(figure, samples):
    v, f = figure
    target_v = cases.moved(v)
    pairs = af.suggest_landmarks(samples, af.MeshSdf(target_v, f), 6)
    assert pairs.shape == (6, 2, 3)
    size = np.linalg.norm(np.ptp(target_v, axis=0))
    away = np.linalg.norm(cases.moved(pairs[:, 0]) - pairs[:, 1], axis=1) / size
    assert np.median(away) < 0.05 and away.max() < 0.2  # the round back slides
    nose = v[v[:, 0].argmax()]
    assert np.linalg.norm(pairs[:, 0] - nose, axis=1).min() < 0.1
    with pytest.raises(af.InvalidInput, match="count"):
        af.suggest_landmarks(samples, af.MeshSdf(v, f), 0)


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
