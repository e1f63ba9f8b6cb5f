# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact of what moves: a body that falls, obstacles that sweep it along, friction, drags there and back."""

import numpy as np
import pytest
import trimesh
from support.geometry import contact_cases
from support.geometry.bar import LEFT, RIGHT, bar_samples, box, turned
from support.geometry.contact_bar import ALIKE, BALL, BLOCK, DEEPEST, PLATE, live

import arapfields as af


@pytest.fixture(scope="module")
def samples():
    return bar_samples(16000)


def test_a_body_that_falls_lands_on_the_ground(samples):
    falling = live(samples, af.Contact(ground=-0.7))
    falling.set_secondary_motion(af.SecondaryMotionOptions(gravity=200.0, damping=0.5))
    lowest = []
    for _ in range(12):
        field = falling.step([LEFT, RIGHT], 1 / 24)
        lowest.append(field(samples.points)[:, 2].min())
    assert min(lowest) > -0.7 - DEEPEST
    assert min(lowest) < -0.69


@pytest.mark.parametrize("handles", [[LEFT], [LEFT, RIGHT]])
def test_a_plate_that_moves_faster_than_it_is_thick_takes_the_shape_along(samples, handles):
    """The plate is 0.03 thick and rises by 0.2 a frame. A handle over it gives way."""
    ends = []
    for rounding in (0.0, 1e-12):
        swept = live(samples, af.Contact([af.Obstacle(PLATE, placement=turned(0, shift=(0, 0, -0.2)))]))
        swept.set_handles([af.Cuboid(handle, handle) for handle in handles])
        swept.solve()
        for k in range(5):
            rise = 0.2 * k - 0.2 + rounding
            swept.set_contact(af.Contact([af.Obstacle(PLATE, placement=turned(0, shift=(0, 0, rise)))]))
            field = swept.solve(iterations=60)  # along the plate's edge the bar slides for long
        ends.append(field(samples.points))
    over = ends[0][:, 0] > 0.05
    assert over.sum() > 4000 and ends[0][over, 2].min() > -0.8 + rise - 2 * DEEPEST
    assert np.abs(ends[1] - ends[0]).max() < ALIKE and swept.report.energy < 0.01


def test_friction_holds_what_slides(samples):
    """A bar falls by 0.01 onto the ground, a slope of 0.2, which holds it with a coefficient of 0.5."""
    ways = []
    for friction in (0.0, 0.5):
        free = af.LiveOptions(samples=800, coarse_centers=30, fine_centers=150, handle_weight=1e-6)
        contact = af.Contact(ground=-0.51, friction=friction)
        resting = af.LiveDeformer(samples, [af.Cuboid(LEFT, LEFT)], free, contact=contact)
        resting.set_secondary_motion(
            af.SecondaryMotionOptions(gravity=30.0, damping=0.0), up=[-0.2, 0, np.sqrt(0.96)]
        )
        for _ in range(12):
            field = resting.step(None, 1 / 24)
        ways.append(field(samples.points)[:, 0].mean() - samples.points[:, 0].mean())
    assert ways[0] > 0.6 and abs(ways[1]) < 0.03
    for _ in range(12):
        field = resting.step(None, 1 / 24)
    later = field(samples.points)[:, 0].mean() - samples.points[:, 0].mean()
    assert abs(later - ways[1]) < 1e-4  # it rests, and does not creep


def test_small_steps_out_of_a_block_go_on_from_each_other(samples):
    """The bar's end begins in the block; what three iterations leave there is no reason to begin anew."""
    placement = turned(0, shift=(0, 0, 0.55))
    lifted = live(samples, af.Contact([af.Obstacle(BLOCK, placement=placement)]))
    energies = []
    for _ in range(6):
        lifted.follow([LEFT, RIGHT], iterations=3, tolerance=3e-5)
        energies.append(lifted.report.energy)
    assert energies[-1] < 0.1 * energies[0] and lifted.report.contact.deepest < DEEPEST


def test_a_drag_onto_a_ball_ends_where_more_steps_end(samples):
    """The handle slides around the ball, which has another plane wherever it goes."""
    pressed = live(samples, af.Contact([af.Obstacle(BALL)]))
    for share in np.linspace(0, 1, 41):
        pose = [LEFT, turned(0, shift=share * np.array([0, 0.3, -1.2])) @ RIGHT]
        pressed.follow(pose)
    end = pressed.field(samples.points)
    further = pressed.solve(pose, iterations=300, tolerance=1e-6)(samples.points)
    assert np.abs(further - end).max() < ALIKE
    (held,) = pressed.report.contact.held
    assert held.handle == 1 and held.by == "obstacles[0]"


def test_a_report_is_of_the_contact_that_is_set(samples):
    pressed = live(samples, af.Contact([af.Obstacle(BALL)]))
    pressed.solve([LEFT, turned(0, shift=(0, 0.3, -1.2)) @ RIGHT])
    assert pressed.report.contact.touching > 0
    pressed.set_contact(None)
    pressed.solve()
    assert pressed.report.contact.touching == 0


def test_a_drag_onto_an_edge_goes_on_as_it_went():
    """Each step starts one step further than the last one. 102 iterations, and 236 from where that ended."""
    case = contact_cases.pressed_bar("edge")
    samples = af.sample_surface(contact_cases.BODIES["bar"], 6000, seed=0)
    live = af.LiveDeformer(samples, case.handles, contact=case.contact())
    iterations = 0
    for share in np.linspace(0, 1, 49)[1:]:
        live.follow(case.pose(share))
        iterations += live.report.iterations
    assert live.report.contact.held and iterations < 160


def test_legs_that_a_drag_has_crossed_come_back():
    """On the way back the feet meet and hold each other apart, where a solve from rest has none crossed."""
    (case,) = [case for case in contact_cases.figures() if case.name == "legs crossed 1"]
    samples = af.sample_surface(contact_cases.BODIES["figure"], 20000, seed=0)
    live = af.LiveDeformer(samples, case.handles, contact=af.Contact(itself=True))
    rest = [handle.rest for handle in case.handles]
    start = live.solve(rest, iterations=60)(samples.points)
    way, names = np.linspace(0, 1, 41), set()
    for share in (*way, *way[::-1]):
        live.follow([(1 - share) * handle.rest + share * handle.target for handle in case.handles])
        names.update(held.by for held in live.report.contact.held)
    end = live.solve(rest, iterations=60, tolerance=1e-6)(samples.points)
    assert names == {"itself"} and not live.report.contact.held
    assert np.abs(end - start).max() < 1e-3 * np.ptp(samples.points, axis=0).max()


def test_parts_that_cut_each_other_at_rest_slide_freely():
    """Arms that reach into the head above them are pulled inwards; nothing else touches."""
    ball = trimesh.creation.icosphere(4)
    parts = [
        ball.copy().apply_scale(radii).apply_translation(center)
        for radii, center in (
            ((0.17, 0.12, 0.3), (0, 0, 0.7)),
            ((0.35, 0.32, 0.29), (0, 0, 1.15)),
            ((0.3, 0.08, 0.08), (0.27, 0, 0.86)),
            ((0.3, 0.08, 0.08), (-0.27, 0, 0.86)),
        )
    ]
    figure = trimesh.util.concatenate(parts)
    samples = af.sample_mesh(figure.vertices, figure.faces, 8000, seed=0)
    handles = [box([x, 0, z], [r] * 3) for x, z, r in ((0, 0.6, 0.12), (0.5, 0.86, 0.08), (-0.5, 0.86, 0.08))]
    pulled = [turned(0, shift=(x, 0, 0)) @ m for x, m in zip((0, -0.1, 0.1), handles, strict=True)]
    shapes = []
    for contact in (None, af.Contact(itself=True)):
        ends, alike = [af.Cuboid(m, m) for m in handles], af.LiveOptions(locality=0)  # as in contact
        solver = af.LiveDeformer(samples, ends, alike, contact=contact)
        shapes.append(solver.solve(pulled)(samples.points))
    assert (shapes[0] == shapes[1]).all()
