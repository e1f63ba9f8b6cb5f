# SPDX-License-Identifier: GPL-3.0-or-later
"""stylize: the preference rises, strength 0 is the identity, weights and orientation act, errors name."""

import numpy as np
import pytest
from support.geometry import cases, meshes

import arapfields as af

MIDDLE = 5e-3  # of a ball of radius .7, whose mean motion is measured at some of its samples


def quick(**changes):
    settings = dict(width=48, layers=3, iterations=80, batch=200)
    return af.StylizeOptions(**(settings | changes))


@pytest.fixture(scope="module")
def ball():
    vertices, triangles = meshes.sphere(0.7)
    return af.sample_mesh(vertices, triangles, count=2000, seed=0)


def moved_normals(field, samples):
    normals = np.linalg.solve(field.jacobian(samples.points).transpose(0, 2, 1), samples.normals[..., None])[
        ..., 0
    ]
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def mean_preference(field, samples, preferred, sharpness=0.0):
    return af.gauss_preference(moved_normals(field, samples), preferred, sharpness=sharpness).mean()


def test_strength_zero_is_the_identity(ball):
    field = af.stylize(ball, "cube", quick(strength=0.0))
    points = np.random.default_rng(0).uniform(-1, 1, size=(200, 3))
    assert np.abs(field(points) - points).max() < 1e-15  # rounding of the map to the cube and back
    assert np.array_equal(field.jacobian(points), np.broadcast_to(np.eye(3), (200, 3, 3)))


def test_strength_zero_is_the_identity_of_a_radial_field_too(ball):
    field = af.stylize(ball, "cube", af.StylizeOptions(strength=0.0))
    points = np.random.default_rng(0).uniform(-1, 1, size=(200, 3))
    assert np.abs(field(points) - points).max() < 1e-6  # coefficients of single precision


def test_a_style_shows_a_first_result(ball):
    """Ten steps are looked at once, at their end; what few centers found is shown before."""
    task = af.Task()
    task.watch(ball.points, seconds=0.0)
    field = af.stylize(ball, "cube", af.StylizeOptions(iterations=10), task=task)
    off = np.abs(task.watched - field(ball.points)).max()
    assert task.looks == 2 and off < 1e-3


def test_strength_grades_the_effect(ball):
    values = [af.stylize(ball, "cube", quick(strength=s)).report.preference for s in (0.0, 0.15, 1.0)]
    assert values[0] + 0.02 < values[1] < values[2] - 0.02


@pytest.mark.parametrize("style", ["cube", "icosahedron"])
def test_the_preference_rises(ball, style):
    preferred = af.preferred_normals(style)
    before = af.gauss_preference(ball.normals, preferred).mean()
    field = af.stylize(ball, style, quick())
    assert 1 - field.report.preference < 0.5 * (1 - before)
    assert mean_preference(field, ball, preferred) == pytest.approx(field.report.preference, abs=1e-3)
    assert field.report.flipped_share <= 0.001


@pytest.mark.parametrize("shape", ["ball", "torus", "egg"])
def test_every_style_raises_it_on_every_shape(shape):
    vertices, triangles = meshes.torus(0.6, 0.25) if shape == "torus" else meshes.sphere(0.7)
    vertices = vertices * ([1.0, 0.6, 0.75] if shape == "egg" else 1.0)
    samples = af.sample_mesh(vertices, triangles, count=1000, seed=0)
    for style in af.style_names():
        before = af.gauss_preference(samples.normals, af.preferred_normals(style)).mean()
        report = af.stylize(samples, style, quick(width=32, layers=2, iterations=50, batch=100)).report
        assert 1 - report.preference < 0.8 * (1 - before), (style, before, report.preference)


def test_the_lowest_sample_keeps_its_height_and_the_middle_its_place(ball):
    field = af.stylize(ball, "octahedron", quick())
    motion = field(ball.points) - ball.points
    assert abs(motion[ball.points[:, 2].argmin(), 2]) < 1e-6
    assert np.abs(motion[:, :2].mean(axis=0)).max() < MIDDLE < np.abs(motion).max()


def test_orientation_turns_the_style(ball):
    turn = cases.turn([0, 0, 1], 45)[:3, :3]
    field = af.stylize(ball, "cube", quick(), orientation=turn)
    turned = af.preferred_normals("cube") @ turn.T
    assert (
        mean_preference(field, ball, turned)
        > mean_preference(field, ball, af.preferred_normals("cube")) + 0.1
    )
    same = af.stylize(ball, turned, quick())
    assert np.allclose(same(ball.points[:9]), field(ball.points[:9]), atol=1e-6)


def test_weights_leave_the_rest_alone(ball):
    """Only the upper half is styled."""
    upper = ball.points[:, 2] > 0
    field = af.stylize(ball, "cube", quick(), weights=upper.astype(float))
    now = af.gauss_preference(moved_normals(field, ball), af.preferred_normals("cube"))
    before = af.gauss_preference(ball.normals, af.preferred_normals("cube"))
    assert (now - before)[upper].mean() > 2 * abs((now - before)[~upper].mean())


def test_handles_and_style_together(ball):
    top, bottom = cases.box([-1, -1, 0.5], [1, 1, 1]), cases.box([-1, -1, -1], [1, 1, -0.5])
    handles = [cases.moved(bottom), cases.moved(top, cases.shift([0, 0, 0.2]))]
    field = af.stylize(ball, "cube", quick(), handles=handles)
    assert field.report.handle_error_mean < 0.05
    assert field.report.preference > af.gauss_preference(ball.normals, af.preferred_normals("cube")).mean()


def test_bad_input_is_named(ball):
    with pytest.raises(af.InvalidInput, match="cube, tetrahedron"):
        af.stylize(ball, "banana", quick())
    with pytest.raises(af.InvalidInput, match="strength"):
        af.stylize(ball, "cube", quick(strength=1.5))
    with pytest.raises(af.InvalidInput, match="weights"):
        af.stylize(ball, "cube", quick(), weights=np.ones(3))
    with pytest.raises(af.InvalidInput, match="weights"):
        af.stylize(ball, "cube", quick(), weights=np.full(len(ball), -1.0))
    with pytest.raises(af.InvalidInput, match="orientation"):
        af.stylize(ball, "cube", quick(), orientation=np.ones((3, 3)))
    with pytest.raises(af.InvalidInput, match="normals"):
        af.stylize(ball, [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], quick())


@pytest.mark.slow
def test_spot_becomes_a_cube(data_dir):
    samples = cases.published_samples(data_dir / "neural_sdf" / "spot.pt")
    preferred = af.preferred_normals("cube")
    assert af.gauss_preference(samples.normals, preferred).mean() == pytest.approx(0.66, abs=0.02)
    report = af.stylize(samples, "cube", af.StylizeOptions(gauss_weight=2.0, iterations=300)).report
    assert report.preference >= 0.90
    full = af.stylize(samples, "cube", af.StylizeOptions()).report
    assert full["preference"] >= 0.96 and full["flipped_share"] <= 0.001


@pytest.mark.slow
def test_a_ball_becomes_a_cube(ball):
    field = af.stylize(ball, "cube")
    angle = np.degrees(np.arccos(np.clip(np.abs(moved_normals(field, ball)).max(1), -1, 1)))
    areas = np.linalg.norm(
        np.linalg.solve(field.jacobian(ball.points).transpose(0, 2, 1), ball.normals[..., None])[..., 0],
        axis=1,
    ) * np.abs(np.linalg.det(field.jacobian(ball.points)))
    assert areas[angle < 10].sum() / areas.sum() >= 0.80
