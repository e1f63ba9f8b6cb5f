# SPDX-License-Identifier: GPL-3.0-or-later
"""What is of another type, and what no handle may have, is named where it enters."""

import numpy as np
import pytest

import arapfields as af

WRONG = ["x", None, 1.5, 3, True, b"", object(), [], {}, 1j, np.array("2020-01-01", "datetime64[D]"), 10**30]
POINTS = np.eye(3)
SAMPLES = af.SurfaceSamples(POINTS, POINTS)
TRIANGLES = [[0, 1, 2]]
FIELD = af.LiveDeformer(
    SAMPLES,
    [af.PointHandle([1, 0, 0], [1, 0, 0])],
    af.LiveOptions(samples=10, fine_centers=5, coarse_centers=2),
)

CALLS = {
    "count": lambda x: af.sample_mesh(POINTS, TRIANGLES, x),
    "seed": lambda x: af.sample_mesh(POINTS, TRIANGLES, 10, seed=x),
    "threads": lambda x: af.signed_distance(POINTS, TRIANGLES, POINTS, threads=x),
    "task": lambda x: af.signed_distance(POINTS, TRIANGLES, POINTS, task=x),
    "resolution": lambda x: af.extract_surface(af.MeshSdf(POINTS, TRIANGLES), x),
    "refine_thin": lambda x: af.extract_surface(af.MeshSdf(POINTS, TRIANGLES), 9, refine_thin=x),
    "sdf": lambda x: af.extract_surface(x),
    "frame": lambda x: af.SurfaceSamples(POINTS, POINTS, x),
    "scale": lambda x: af.Frame([0, 0, 0], x),
    "fraction": lambda x: af.Task().report(x),
    "message": lambda x: af.Task().report(0.0, x),
    "samples": lambda x: af.deform(x, []),
    "options": lambda x: af.deform(SAMPLES, [], x),
    "field": lambda x: af.distortion(x, POINTS),
    "iterations": lambda x: FIELD.solve(iterations=x),
    "tolerance": lambda x: FIELD.solve(tolerance=x),
    "seconds": lambda x: FIELD.step(None, x),
    "symmetry": lambda x: FIELD.set_symmetry(x),
    "weight": lambda x: af.PointHandle([0, 0, 0], [0, 0, 0], x),
    "allow_scale": lambda x: af.CuboidHandle(np.eye(4), np.eye(4), allow_scale=x),
    "strength": lambda x: FIELD.solve().apply(POINTS, strength=x),
    "closed": lambda x: af.sample_curve(np.eye(2), 9, closed=x),
}


@pytest.mark.parametrize("name", CALLS)
def test_wrong_types_are_invalid_input_that_names_the_argument(name):
    refused = 0
    for value in WRONG:
        try:
            CALLS[name](value)
        except af.InvalidInput as error:
            refused += str(error).startswith(f"{name}: ")
            assert "incompatible function arguments" not in str(error)
    assert refused >= 4


def test_a_wrong_type_is_a_type_error_too():
    with pytest.raises(TypeError, match=r"count: got .*str.*an integer is needed") as error:
        af.sample_mesh(POINTS, TRIANGLES, "x")
    assert isinstance(error.value, af.InvalidInput)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: af.sample_mesh(POINTS), "triangles: is missing"),
        (
            lambda: af.sample_mesh(POINTS, TRIANGLES, sede=1),
            "sede: there is no such argument; sample_mesh() takes",
        ),
        (lambda: af.sample_mesh(POINTS, TRIANGLES, vertices=POINTS), "vertices: is given twice"),
        (lambda: af.Task().cancel(3), "arguments: there are too many; cancel() takes nothing"),
        (lambda: af.Task.cancel(None), "self: got"),
        (lambda: af.LiveDeformer(), "samples: is missing"),
        (lambda: FIELD.solve(steps=3), "steps: there is no such argument; solve() takes"),
    ],
)
def test_missing_and_unknown_arguments_are_named(call, says):
    with pytest.raises(af.InvalidInput) as error:
        call()
    assert str(error.value).startswith(says) and isinstance(error.value, TypeError)


@pytest.mark.parametrize("weight", [0.0, -1.0, np.nan, np.inf])
def test_weights_are_checked_where_they_enter(weight):
    for make in (
        lambda: af.PointHandle([0, 0, 0], [0, 0, 0], weight),
        lambda: af.CuboidHandle(np.eye(4), np.eye(4), weight),
        lambda: af.RegionHandle([0], np.eye(4), np.eye(4), weight),
        lambda: af.CurveHandle([0], weight=weight),
    ):
        with pytest.raises(af.InvalidInput, match="weight"):
            make()


def test_indices_and_motions_are_checked_where_they_enter():
    with pytest.raises(af.InvalidInput, match=r"samples: -1"):
        af.RegionHandle([-1], np.eye(4), np.eye(4))
    with pytest.raises(af.InvalidInput, match=r"samples: -1"):
        af.CurveHandle([-1])
    for motion in (2 * np.eye(3), np.diag([1.0, -1.0, 1.0]), np.full((3, 3), np.nan)):
        with pytest.raises(af.InvalidInput, match="motion"):
            af.CurveHandle([0], motion)
