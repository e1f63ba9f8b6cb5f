# SPDX-License-Identifier: GPL-3.0-or-later
"""Solves in contact that go on to their end: what is as small as rounding hardly changes the pose."""

import numpy as np
import pytest
from support.geometry import contact_cases
from support.geometry.bar import LEFT, RIGHT, bar_samples, turned
from support.geometry.contact_bar import BALL, BLOCK, DEEP, PLATE, live

import arapfields as af

JITTER = 1e-9
SIZE = 4.0
# Shares of the size between the farthest two of the poses. Over an edge of the block the bar slides for
# long; .031 of 16 poses where rounds were short and ended early, .0021 on the ball.
SPREADS = {"ball": (BALL, 0.0015), "block": (BLOCK, 0.01)}
# Of 32 poses at most .0005 from the median. Where what the plate's edge passed was taken to have come to its
# other side, three were .004 to .008; where solves beside it ended early, one in 48.
ON_A_PLATE = 0.002
# A thousandth of a figure's height. Solves that ended early left .002 to .0035.
STILL_DEEP = 0.0014
# Ratio of the greatest energy to the least: 1.017 in 24 poses. Legs that block each other have a thirtieth of
# it, with handles .26 and .37 from their targets.
ALIKE_IN_ENERGY = 1.03


@pytest.fixture(scope="module")
def samples():
    return bar_samples(16000)


def spread(pose_of, seeds=8):
    """How far poses of jittered handles are from each other, as a share of the size."""
    rows = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        rows.append(pose_of([turned(0, shift=JITTER * rng.normal(size=3)) for _ in range(2)]))
    return np.ptp(np.array(rows), axis=0).max() / SIZE


@pytest.mark.parametrize("name", SPREADS)
def test_a_bar_that_is_pressed_on_ends_alike(samples, name):
    function, alike = SPREADS[name]

    def pose_of(jitters):
        pressed = live(samples, af.Contact([af.Obstacle(function)]))
        pose = [jitter @ end for jitter, end in zip(jitters, DEEP, strict=True)]
        return pressed.solve(pose, iterations=60, tolerance=1e-4)(samples.points)

    assert spread(pose_of) < alike


def test_a_plate_that_sweeps_a_bar_along_leaves_it_alike(samples):
    def pose_of(jitters):
        def plate(rise):
            place = turned(0, shift=(0, 0, rise)) @ jitters[0]
            return af.Contact([af.Obstacle(PLATE, placement=place)])

        swept = live(samples, plate(-0.2))
        swept.solve([LEFT, RIGHT])
        for k in range(5):
            swept.set_contact(plate(0.2 * k - 0.2))
            field = swept.solve(iterations=60)
        return field(samples.points)

    assert spread(pose_of) < ON_A_PLATE


@pytest.mark.parametrize("centers", [200, 400])
@pytest.mark.parametrize("k", [0, 1])
def test_legs_are_crossed_in_one_go(k, centers):
    """A solve without contact leaves them in each other, and they block each other on a straight way."""
    (case,) = [case for case in contact_cases.figures() if case.name == f"legs crossed {k}"]
    samples = af.sample_surface(contact_cases.BODIES["figure"], 6000, seed=0)
    options = af.DeformOptions(centers=centers)
    energies = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        jitters = [turned(0, shift=JITTER * rng.normal(size=3)) for _ in case.handles]
        handles = [
            af.Cuboid(h.rest, jitter @ h.target) for h, jitter in zip(case.handles, jitters, strict=True)
        ]
        report = af.deform(samples, handles, options, contact=af.Contact(itself=True)).report
        assert not report.contact.held and report.contact.deepest < STILL_DEEP
        energies.append(report.energy)
    assert max(energies) < ALIKE_IN_ENERGY * min(energies)


def test_legs_that_slide_past_each_other_do_so_with_few_centers():
    """With all centers 40 iterations; 82 where they slid with all of them."""
    (case,) = [case for case in contact_cases.figures() if case.name == "legs crossed 0"]
    samples = af.sample_surface(contact_cases.BODIES["figure"], 20000, seed=0)
    report = af.deform(samples, case.handles, contact=af.Contact(itself=True)).report
    assert report.iterations <= 60 and not report.contact.held and report.contact.deepest < STILL_DEEP
