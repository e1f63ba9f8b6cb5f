# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles that reach so far and no farther."""

import numpy as np
import pytest
from support.geometry.cases import box, moved, shift
from support.geometry.characters import FOOT, HIP, LEG, trousers
from support.geometry.meshes import LEFT, RIGHT, bar_samples
from support.tolerances import TRACKED

import arapfields as af


@pytest.fixture(scope="module")
def body():
    return af.sample_surface(trousers(), 3000, seed=0)


FOOT_AT = np.array([LEG, 0.0, FOOT])
PULLED = FOOT_AT + np.array([0.05, 0.1, 0.0])
REACH = 0.35


def pin(target=PULLED, **settings):
    return af.Point(FOOT_AT, target, **{"reach": REACH, **settings})


@pytest.fixture(scope="module")
def pulled(body):
    return af.deform(body, [pin()])


def test_beyond_its_reach_nothing_moves_to_the_last_bit(body, pulled):
    field = pulled
    points = np.random.default_rng(0).uniform([-0.5, -0.5, -0.2], [0.5, 0.5, 1.4], (20000, 3))
    beyond = np.linalg.norm(points - FOOT_AT, axis=1) > REACH
    assert np.array_equal(field(points[beyond]), points[beyond])
    assert np.array_equal(field.jacobian(points[beyond][:50]), np.broadcast_to(np.eye(3), (50, 3, 3)))
    assert np.linalg.norm(field([FOOT_AT])[0] - PULLED) < 0.02
    # The other foot is within it in space, but not through the inside of the shape.
    other = body.points[(body.points[:, 0] < 0) & (body.points[:, 2] < 0.2)]
    assert np.linalg.norm(other - FOOT_AT, axis=1).min() < REACH
    assert np.array_equal(field(other), other)
    assert field.report.flipped_share == 0


def test_it_falls_off_smoothly(pulled):
    """Derivatives are those of the values, on a line from the foot to beyond its reach."""
    field = pulled
    way = np.linspace(0, 1.3, 200)[:, None]
    line = FOOT_AT + way * [0, 0, REACH]
    J, step = field.jacobian(line), 1e-5
    for k in range(3):
        e = step * np.eye(3)[k]
        assert np.abs((field(line + e) - field(line - e)) / (2 * step) - J[:, :, k]).max() < 1e-5
        D = (field.jacobian(line + e) - field.jacobian(line - e)) / (2 * step)
        hessian = field.hessian(line)[..., k]
        assert np.abs(D - hessian).max() < 1e-4 * max(1.0, np.abs(hessian).max())
    moves = np.linalg.norm(field(line) - line, axis=1)
    assert moves[0] > 0.08 and (moves[way[:, 0] > 1] == 0).all()


def test_an_anchor_holds_and_a_handle_without_reach_frees_all(body):
    trunk = moved(box([-1, -1, 0.9], [1, 1, 2]))
    field = af.deform(body, [trunk, pin()])
    head = body.points[body.points[:, 2] > 1]
    assert np.array_equal(field(head), head)
    free = af.deform(body, [moved(trunk.rest, shift([0, 0.1, 0])), pin()])
    assert np.linalg.norm(free(head) - head, axis=1).min() > 0.05


def test_boxes_and_regions_reach_from_their_samples():
    samples = bar_samples(3000)
    target = shift([0, 0, 0.3]) @ RIGHT
    inside = np.flatnonzero(samples.points[:, 0] > 1.5)
    for handle in (af.Cuboid(RIGHT, target, reach=1.0), af.Region(inside, RIGHT, target, reach=1.0)):
        field = af.deform(samples, [handle])
        far = samples.points[samples.points[:, 0] < 0.49]
        assert np.array_equal(field(far), far)
        held = samples.points[inside]
        assert np.abs(field(held) - held - [0, 0, 0.3]).max() < 0.05
    assert af.Cuboid(LEFT, LEFT).reach == 0


def test_live_sessions_heed_it(body):
    live = af.LiveDeformer(body, [pin(FOOT_AT)])
    points = body.points
    live.track(points)
    for share in (0.5, 1.0):
        field = live.solve([FOOT_AT + share * (PULLED - FOOT_AT)])
    beyond = np.linalg.norm(points - FOOT_AT, axis=1) > REACH
    assert np.array_equal(field(points[beyond]), points[beyond])
    assert np.array_equal(live.tracked()[beyond], points[beyond].astype(np.float32))
    assert np.abs(live.tracked() - field(points)).max() < TRACKED
    live.set_handles([pin(reach=0.0)])
    assert np.linalg.norm(live.solve()(points[beyond]) - points[beyond], axis=1).max() > 1e-3
    live.set_symmetry("x")
    live.set_handles([pin()])
    tied = live.solve(iterations=60)
    assert np.abs(tied(points * [-1, 1, 1]) - tied(points) * [-1, 1, 1]).max() < 1e-6
    assert np.array_equal(tied(points[points[:, 2] > 0.6]), points[points[:, 2] > 0.6])
    with pytest.raises(af.InvalidInput, match="reach"):
        live.set_style("cube")
    live.solve()


def test_files_keep_it(body, pulled, tmp_path):
    pulled.save(tmp_path / "pose.safetensors")
    again = af.DeformationField.load(tmp_path / "pose.safetensors")
    assert np.array_equal(again(body.points), pulled(body.points))


def test_an_attachment_leaves_what_is_beyond(body, pulled):
    hat = np.random.default_rng(1).normal(size=(500, 3)) * 0.05 + [0, 0, 1.3]
    assert np.abs(af.Attachment(body, hat).positions(pulled) - hat).max() < 1e-9


def test_where_there_can_be_no_reach(body):
    for bad in (-1.0, np.nan, np.inf):
        with pytest.raises(af.InvalidInput, match="reach"):
            pin(reach=bad)
    for options in ({"exact_handles": True}, {"field": "neural"}):
        with pytest.raises(af.InvalidInput, match=r"handles\[0\].reach"):
            af.deform(body, [pin()], af.DeformOptions(**options))
    with pytest.raises(af.InvalidInput, match=r"handles\[0\].reach"):
        af.stylize(body, "cube", handles=[pin()])
    assert HIP > REACH  # the trunk is out of it
