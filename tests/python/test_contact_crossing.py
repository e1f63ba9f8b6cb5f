# SPDX-License-Identifier: GPL-3.0-or-later
"""Obstacles that cross the shape where it begins: neither of their sides is the one that it comes from."""

import numpy as np
import pytest
import trimesh
from support.geometry.bar import LEFT, RIGHT, bar_samples, turned
from support.geometry.contact_bar import ALIKE, DEEPEST, live, solid

import arapfields as af

# What is beside an obstacle keeps its distance from it.
BESIDE = 0.02
CROSSINGS = {
    "plate": ((0.04, 1.5, 1.5), [0.4, 0, 0]),
    "thin plate": ((0.004, 1.5, 1.5), [0.4, 0, 0]),
    "rod": ((0.1, 0.1, 3.0), [0.0, 0, 0]),
    "plate along it": ((3.0, 1.5, 0.04), [1.5, 0, 0.0]),
}


def box_at(extents, center):
    mesh = trimesh.creation.box(extents).subdivide().subdivide()
    return solid(mesh, center)


@pytest.mark.parametrize(("extents", "center"), CROSSINGS.values(), ids=CROSSINGS)
def test_an_obstacle_that_crosses_the_shape_tears_nothing(extents, center):
    samples = bar_samples(8000)
    across = af.Contact([af.Obstacle(box_at(extents, center))])
    pressed = live(samples, across)
    rest = pressed.solve(iterations=60)(samples.points)
    assert np.abs(rest - samples.points).max() < BESIDE
    turn = [LEFT, turned(0, shift=(0, 0.2, 0)) @ RIGHT]
    field = pressed.solve(turn, iterations=60)
    assert pressed.report.flipped_share == 0 and pressed.report.max_stretch < 1.5
    again = live(samples, across).solve(turn, iterations=60)
    assert np.abs(again(samples.points) - field(samples.points)).max() < ALIKE


def test_what_crosses_is_named():
    ball = solid(trimesh.creation.icosphere(3, 0.3), [0, 0, 0.7])
    contact = af.Contact([af.Obstacle(ball), af.Obstacle(box_at(*CROSSINGS["plate"]))])
    handles = [af.Cuboid(matrix, matrix) for matrix in (LEFT, RIGHT)]
    report = af.deform(bar_samples(2000), handles, contact=contact).report
    assert report.contact.crossing == ("obstacles[1]",)
    assert "obstacles[1] crosses the surface" in " ".join(report.notes)
    assert report.contact.touching > 0  # the ball, which is not so deep, presses
    alone = af.deform(bar_samples(2000), handles, contact=af.Contact([af.Obstacle(ball)])).report
    assert alone.contact.crossing == ()


def test_nothing_crosses_without_contact():
    shape = live(bar_samples(4000), af.Contact([af.Obstacle(box_at(*CROSSINGS["plate"]))]))
    shape.solve()
    assert shape.report.contact.crossing == ("obstacles[0]",)
    for contact in (None, af.Contact(itself=True)):
        shape.set_contact(contact)
        shape.solve([LEFT, turned(20) @ RIGHT])
        assert shape.report.contact.crossing == ()


@pytest.mark.parametrize("height", [0.03, -0.03])
def test_a_ball_sunk_by_half_is_on_the_side_of_its_middle(height):
    samples = bar_samples(4000)
    ball = solid(trimesh.creation.icosphere(4, 0.3), [0, 0, 0.5 + height])
    handles = [af.Cuboid(matrix, matrix) for matrix in (LEFT, RIGHT)]
    field = af.deform(samples, handles, contact=af.Contact([af.Obstacle(ball)]))
    moved = field(samples.points)
    assert ball(moved).min() > -DEEPEST
    assert field.report.contact.crossing == () and field.report.max_stretch < 1.5
    assert (moved[:, 2].max() > 0.7) == (height < 0)


def test_motion_goes_on_from_its_state_where_an_obstacle_crosses():
    samples = bar_samples(8000)
    contact = af.Contact([af.Obstacle(box_at(*CROSSINGS["plate"]))])
    ways = []
    for resumes in (False, True):
        body = live(samples, contact)
        body.set_secondary_motion(af.SecondaryMotionOptions(gravity=2.0))
        for frame in range(6):
            pose = [LEFT, turned(0, shift=(0, 0.05 * min(frame, 3), 0)) @ RIGHT]
            field = body.step(pose, 1 / 24)
            if resumes:
                body.motion_state = body.motion_state
        ways.append(field(samples.points))
    assert np.abs(ways[0] - ways[1]).max() < 1e-3
