# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks of a wrap: met, refused, named where they lie, suggested."""

import numpy as np
import pytest
from support.geometry import wrap_cases as cases

import arapfields as af

# Landmarks are met, in % of the target's diagonal: far below what a click is off.
LANDMARKS_MET = 0.1
# The same of a tip that turns by more than half a circle under a few centers.
TIP_MET = 0.5


def test_landmarks_are_met_where_the_surface_slides_along_itself():
    """An egg onto itself, by pairs that are twisted about its axis: only they tell."""
    v, f = cases.sphere(1.0, 3)
    v = v * [1.0, 0.8, 1.6]
    angle = 0.35 * v[:, 2]
    x, y = v[:, 0], v[:, 1] / 0.8
    twisted = np.stack(
        [np.cos(angle) * x - np.sin(angle) * y, 0.8 * (np.sin(angle) * x + np.cos(angle) * y), v[:, 2]],
        axis=1,
    )
    chosen = np.linspace(0, len(v) - 1, 16, dtype=int)
    pairs = list(zip(v[chosen], twisted[chosen], strict=True))
    report = af.wrap(
        af.sample_mesh(v, f, 1500), af.MeshSdf(v, f), pairs, af.WrapOptions(**cases.SMALL)
    ).report
    assert not report.left_out and report.flipped_share == 0
    assert max(report.landmarks) < LANDMARKS_MET / 100 * report.diagonal


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


@pytest.mark.parametrize("seed", [2, 6, 11, 24])
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


@pytest.mark.parametrize(("curl", "target_curl"), [(2.2, -1.5), (3.0, -1.0), (2.1, -2.0)])
def test_a_landmark_that_unbends_a_tail_is_followed(curl, target_curl):
    """It costs much stretch, and takes the whole tail onto the target's."""
    v, f, ends = cases.tailed(curl)
    target_v, _, _ = cases.tailed(target_curl)
    pairs = list(zip(v[ends], target_v[ends], strict=True))
    report = af.wrap(
        af.sample_mesh(v, f, 1500), af.MeshSdf(target_v, f), pairs, af.WrapOptions(**cases.SMALL)
    ).report
    assert not report.left_out and max(report.landmarks) < TIP_MET / 100 * report.diagonal


# Told to the third next, rounding decides whether seven of the ten are found to agree.
@pytest.mark.parametrize(("step", "is_tie"), [(5, False), (3, True)])
def test_landmarks_of_which_most_lie_are_not_followed_without_a_word(figure, samples, step, is_tie):
    v, f = figure
    target_v, ends = cases.moved(v), ends_of(v)
    pairs = [(v[a], target_v[b]) for a, b in zip(ends, ends[step:] + ends[:step], strict=True)]
    options = af.WrapOptions(centers=20, stages=1, iterations=1)
    report = af.wrap(samples, af.MeshSdf(target_v, f), pairs, options).report
    words = " ".join(report.notes)
    if is_tie and report.left_out:
        assert all(f"landmarks[{row}] contradicts the others" in words for row in report.left_out)
    else:
        assert not report.left_out and "contradict each other" in words


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
