# SPDX-License-Identifier: GPL-3.0-or-later
"""A radial result turns, scales and mirrors with its mesh, and does not see what is small and far away."""

import numpy as np
import pytest
from support.geometry import cases, meshes

import arapfields as af

COUNT = 12000
# Mean distance over the surface, of the largest motion. Where triangles' corners or the list of triangles
# change, other samples stand for the same surface, and other centers among them.
SAME = 5e-3
ROUNDING = 3e-4  # a solve ends where its next step would gain a part in 100,000 of the energy


def body():
    """A lopsided blob without symmetries."""
    v, f = meshes.sphere(subdivisions=4)
    return v * [1.6, 0.7, 0.5] + 0.12 * np.sin(2.0 * v[:, [1, 2, 0]] + [0.0, 1.0, 2.0]), f


def boxes():
    low, high = cases.box([-3, -2, -2], [-1.0, 2, 2]), cases.box([1.0, -2, -2], [3, 2, 2])
    return [low, high], [np.eye(4), cases.turn([0, 1, 0.3], 50, (0.2, 0, 0))]


def motion(placed, vertices, triangles, count=COUNT, centers=300):
    """Where the body's vertices go after the similarity `placed`, brought back to where they were."""
    moved = vertices @ placed[:3, :3].T + placed[:3, 3]
    proper = np.diag([np.sign(np.linalg.det(placed[:3, :3])), 1, 1, 1])  # a box's axis may be turned over
    back = np.linalg.inv(placed)
    handles = [
        af.Cuboid(placed @ rest @ proper, placed @ move @ rest @ proper)
        for rest, move in zip(*boxes(), strict=True)
    ]
    samples = af.sample_mesh(moved, triangles, count=count)
    field = af.deform(samples, handles, af.DeformOptions(field="radial", centers=centers))
    return field(moved) @ back[:3, :3].T + back[:3, 3] - vertices


def off(found, expected):
    return np.linalg.norm(found - expected, axis=1).mean() / np.linalg.norm(expected, axis=1).max()


@pytest.fixture(scope="module")
def at_rest():
    return motion(np.eye(4), *body())


SIMILARITIES = {
    "turned": cases.turn([1, 2, 3], 37),
    "turned over": cases.turn([1, 0, 0], 90),
    "moved": cases.shift([30.0, -20.0, 5.0]),
    "large": np.diag([1e4, 1e4, 1e4, 1.0]),
    "small": np.diag([1e-4, 1e-4, 1e-4, 1.0]),
}


@pytest.mark.parametrize("name", SIMILARITIES)
def test_similar_meshes_move_alike(at_rest, name):
    assert off(motion(SIMILARITIES[name], *body()), at_rest) < ROUNDING


def test_a_mirrored_mesh_moves_mirrored(at_rest):
    """Triangles are turned over, so other points of them are drawn."""
    v, f = body()
    samples_differ = motion(np.diag([-1.0, 1, 1, 1]), v, np.ascontiguousarray(f[:, ::-1]))
    assert off(samples_differ, at_rest) < SAME


def test_what_is_small_and_far_changes_nothing(at_rest):
    v, f = body()
    small, g = meshes.sphere(0.02, subdivisions=1)
    both = np.concatenate([v, small + np.array([40.0, 25.0, -10.0])])
    shape = motion(np.eye(4), both, np.concatenate([f, g + len(v)]))[: len(v)]
    assert off(shape, at_rest) < SAME
