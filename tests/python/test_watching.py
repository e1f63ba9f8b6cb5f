# SPDX-License-Identifier: GPL-3.0-or-later
"""A Task that watches points sees the present shape while a solve runs, and changes nothing of it."""

import numpy as np
import pytest
from support.geometry.bar import LEFT, RIGHT, bar_samples, turned

import arapfields as af

SMALL = {"width": 32, "layers": 2, "batch": 200, "iterations": 60}
HANDLES = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, turned(30) @ RIGHT)]


@pytest.mark.parametrize("field", ["neural", "radial"])
def test_a_watched_solve_shows_the_shape_and_ends_the_same(field):
    samples = bar_samples(2000)
    options = af.DeformOptions(field=field, **SMALL)
    alone = af.deform(samples, HANDLES, options)
    task = af.Task()
    points = samples.points[:50]
    assert task.looks == 0 and task.watched.shape == (0, 3)
    task.watch(points, seconds=0.0)
    watched = af.deform(samples, HANDLES, options, task=task)
    assert np.array_equal(alone(points), watched(points))
    assert task.looks > 0 and task.watched.shape == points.shape
    assert np.abs(task.watched - points).max() > 0.01  # it had begun to move
    if field == "radial":
        assert np.abs(task.watched - watched(points)).max() < 1e-5


@pytest.mark.parametrize("options", [SMALL | {"field": "neural"}, {}])
def test_the_first_shape_there_is_is_shown(options):
    """However long is to be waited between two looks."""
    samples, task = bar_samples(2000), af.Task()
    task.watch(samples.points[:50], seconds=1000.0)
    af.deform(samples, HANDLES, af.DeformOptions(**options), task=task)
    assert task.looks == 1


def test_points_that_cannot_be_watched_are_named():
    with pytest.raises(af.InvalidInput, match="points"):
        af.Task().watch(np.full((2, 3), np.nan))
    with pytest.raises(af.InvalidInput, match="seconds"):
        af.Task().watch(np.zeros((2, 3)), seconds=-1.0)
