# SPDX-License-Identifier: GPL-3.0-or-later
"""What a body carries, fitted to the body that it was wrapped onto."""

import numpy as np
import pytest
from support.geometry.meshes import sphere

import arapfields as af
from addon.core.geometry import transfer

DISTANCE = 0.02  # of clothes from a ball of radius 1
CLOSE = 0.2  # of that
SAME = 1e-9  # of the radius: sums in another order
STILL = 1e-3  # of the radius: what hardly counts moves by no more


@pytest.fixture
def ball():
    return sphere(1.0, 4)


def test_clothes_keep_their_distance_after_a_wrap(ball):
    v, f = ball
    body = transfer.Body(af, (v, v, f), (v, f))
    for left in (-0.5, 0.2):
        shape = body.fit((1 + DISTANCE) * v, (1 + left * DISTANCE) * v, f)
        assert np.abs(af.MeshSdf(v, f)(shape) / DISTANCE - 1).max() < CLOSE


def test_points_far_from_the_skin_follow_the_wrap(ball):
    """A body that grows to four times its size: a hat that does not need not be pushed away."""
    v, f = ball
    body = transfer.Body(af, (v / 4, v, f), (v, f))
    hat = 1.3 * v
    assert np.abs(body.fit(0.75 * v, hat, f) - hat).max() < STILL


def test_where_the_other_body_has_a_gap_clothes_stay(ball):
    """As under an avatar's clothes, where its skin is removed."""
    v, f = ball
    kept = (v[f] @ [0, 0, 1]).max(axis=1) < 0.3
    body = transfer.Body(af, (v, v, f), (v, f[kept]))
    worn = (1 + DISTANCE) * v
    shape, above = body.fit(worn, worn, f), v[:, 2] > 0.7
    assert np.abs(shape - worn)[above].max() < STILL


def test_clothes_whose_vertices_are_split_at_seams_stay_closed():
    """As game formats write them: each triangle by itself. They go where the joined ones go."""
    v, f = sphere(1.0, 4)
    body = transfer.Body(af, (v, v, f), (v, f))
    near = 1 + DISTANCE * (0.2 + 0.1 * np.sin(9 * v))
    joined = body.fit((1 + DISTANCE) * v, near * v, f)
    split = body.fit(
        (1 + DISTANCE) * v[f].reshape(-1, 3), (near * v)[f].reshape(-1, 3), np.arange(f.size).reshape(-1, 3)
    )
    assert np.abs(split - joined[f].reshape(-1, 3)).max() < SAME
