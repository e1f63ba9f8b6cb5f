# SPDX-License-Identifier: GPL-3.0-or-later
"""What no handle has to move stays in place."""

import numpy as np
import pytest
from support.geometry import meshes
from support.geometry.cases import bar_handles, bar_samples, moved, shift, turn
from support.geometry.meshes import BEND, BOTTOM, LEG, LEGS, TIP, fork_samples, handle_box

import arapfields as af

SIZE = 2 * LEG  # of the fork, about
LESS = 0.15  # of its way without locality: how far the other leg moves
RIGID = 1e-3  # of the size
FARTHER = 0.05  # of the size: where one handle differs
WEIGHT = af.DeformOptions().locality
DEFORM = dict(centers=300, locality=WEIGHT)
MIDDLE = BOTTOM @ np.diag([0.2, 1, 1, 1])  # of the bend
MIDWAY = handle_box([-BEND, 0, 0.4 * LEG], [0.2, 0.2, 0.2])  # of the other leg
BENT = turn([1, 0, 0], 40, (0, 0, 0.3))


@pytest.fixture(scope="module")
def samples():
    return fork_samples()


def deformed(samples, handles, **options):
    return af.deform(samples, handles, af.DeformOptions(**DEFORM | options))


def dragged(samples, handles, **options):
    """By live mode, from rest."""
    return af.LiveDeformer(samples, handles, af.LiveOptions(**{"locality": WEIGHT} | options)).solve(
        iterations=100, tolerance=1e-6
    )


def trained(samples, handles, **options):
    """By a small network."""
    network = dict(field="neural", width=64, layers=2, iterations=300, seed=0)
    return af.deform(samples, handles, af.DeformOptions(**network | {"locality": WEIGHT} | options))


SOLVES = pytest.mark.parametrize("solve", [deformed, dragged])


def way(field, points):
    return np.linalg.norm(field(points) - points, axis=1).max()


@pytest.mark.parametrize("solve", [deformed, dragged, trained])
def test_the_other_leg_of_a_fork_stays(samples, solve):
    handles = [moved(MIDDLE), moved(TIP, BENT)]
    other = samples.points[samples.points[:, 0] < -0.1]
    assert way(solve(samples, handles), other) < LESS * way(solve(samples, handles, locality=0), other)


@SOLVES
@pytest.mark.parametrize("far", [0.02, 0.1, 2.0])
def test_one_motion_of_all_handles_carries_the_whole(samples, solve, far):
    motion = turn([1, 2, 0], 100 * far, (0, 0.2, 0.1)) @ shift([0.3 * far * SIZE, far * SIZE, 0])
    field = solve(samples, [moved(BOTTOM, motion), moved(TIP, motion)])
    expected = samples.points @ motion[:3, :3].T + motion[:3, 3]
    assert np.abs(field(samples.points) - expected).max() < RIGID * SIZE


@SOLVES
@pytest.mark.parametrize("far", [0.02, 0.1, 2.0])
def test_of_four_handles_the_one_that_differs_moves_its_leg_alone(samples, solve, far):
    motion = turn([1, 2, 0], 100 * far, (0, 0.2, 0.1)) @ shift([0.3 * far * SIZE, far * SIZE, 0])
    mirrored = np.diag([-1.0, 1, 1, 1])
    shared = [moved(box, motion) for box in (BOTTOM, mirrored @ TIP @ mirrored, MIDWAY)]
    field = solve(samples, [*shared, moved(TIP, motion @ shift([0, FARTHER * SIZE, 0]))])
    expected = samples.points @ motion[:3, :3].T + motion[:3, 3]
    off = np.linalg.norm(field(samples.points) - expected, axis=1)
    on_its_side = samples.points[:, 0] > 0
    assert off[on_its_side].max() > 0.9 * FARTHER * SIZE
    assert off[~on_its_side].max() < RIGID * SIZE


@SOLVES
@pytest.mark.parametrize("size", [0.05, 0.1])
def test_a_pin_alone_takes_its_surroundings(samples, solve, size):
    tip, way = LEGS[1][0], size * SIZE * np.array([0.2, 1.0, 0.1])
    field = solve(samples, [af.Point(tip, tip + way)])
    assert np.linalg.norm(field([tip]) - tip - way) < 0.05 * np.linalg.norm(way)
    other = samples.points[(samples.points[:, 0] < -0.1) & (samples.points[:, 2] > 0.5 * LEG)]
    assert np.linalg.norm(field(other) - other, axis=1).max() < 0.01 * SIZE


@SOLVES
def test_a_pin_pulled_far_takes_the_whole_along(samples, solve):
    tip, way = LEGS[1][0], 0.5 * SIZE * np.array([0.2, 1.0, 0.1])
    field = solve(samples, [af.Point(tip, tip + way)])
    other = samples.points[samples.points[:, 0] < -0.1]
    assert np.linalg.norm(field(other) - other, axis=1).min() > 0.2 * SIZE
    assert np.linalg.det(field.jacobian(samples.points)).min() > 0


@SOLVES
def test_a_handle_of_nearly_all_carries_the_whole(samples, solve):
    motion = turn([1, 2, 0], 20, (0, 0.2, 0.1)) @ shift([0.02, 0.1, 0])
    field = solve(samples, [moved(handle_box([0, 0, 0.5], [0.6, 0.6, 0.6]), motion)])
    expected = samples.points @ motion[:3, :3].T + motion[:3, 3]
    assert np.abs(field(samples.points) - expected).max() < RIGID * SIZE


@SOLVES
def test_a_part_that_nothing_holds_goes_along(solve):
    ball = meshes.sphere(1.0, 4)
    speck = meshes.sphere(0.1, 2)[0] + [0, 0, 1.2]
    both = (
        np.concatenate([ball[0], speck]),
        np.concatenate([ball[1], meshes.sphere(0.1, 2)[1] + len(ball[0])]),
    )
    samples = af.sample_mesh(*both, 4000)
    south = np.array([0, 0, -1.0])
    handles = [af.Point(south, south), af.Point(-south, -1.4 * south)]
    field = solve(samples, handles)
    assert np.abs(field(speck) - speck - [0, 0, 0.4]).max() < 0.1


def test_styles_and_secondary_motion_do_without():
    live = af.LiveDeformer(bar_samples(), bar_handles(), af.LiveOptions(fine_centers=60, locality=WEIGHT))
    live.solve()
    assert live.report.terms["locality"] > 0
    live.set_style(af.preferred_normals("cube"), 1.0)
    live.solve()
    assert "locality" not in live.report.terms and "style" in live.report.terms
    live.set_style(af.preferred_normals("cube"), 0.0)
    live.set_secondary_motion(af.SecondaryMotionOptions())
    live.solve()
    assert "locality" not in live.report.terms
