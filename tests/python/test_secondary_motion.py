# SPDX-License-Identifier: GPL-3.0-or-later
"""Secondary motion on a bar that is held at one end: how it swings does not depend on how it is solved."""

import threading
import time

import numpy as np
import pytest
import torch
from support.geometry.meshes import LEFT, RIGHT, bar_samples, handle_box, turned
from support.oracles import gradient_of
from support.tolerances import FLOAT32_ENERGY, FLOAT64_GRADIENT

import arapfields as af
from arapfields._native import testing

QUICK = {"samples": 600, "coarse_centers": 20, "fine_centers": 80}
TIP = np.array([[2.0, 0.0, 0.0]])
# Agreed: of the total energy's rise, of changes of period and decay; the last between 360 and 1,500 centers.
ENERGY_RISE, ALIKE, FINER_ALIKE = 0.01, 0.05, 0.06
DECAY = 0.15  # of a rate against what was asked for: energy falls in turns, as it is kinetic or not
SUNK = 8e-3  # below the ground: a fifth of a per cent of the length
SEEN = 1e-5  # of the energy at the start, a 300th of the amplitude: single precision tells steps apart so far


@pytest.fixture(scope="module")
def samples():
    return bar_samples(3000)


def released(surface, angle=35.0, further=(), **options):
    """A bar that was bent by so many degrees without locality, and of which one end is let go."""
    options = af.LiveOptions(**(QUICK | {"locality": 0} | options))
    live = af.LiveDeformer(surface, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)], options)
    live.solve([LEFT, turned(angle) @ RIGHT], iterations=300, tolerance=1e-6)
    live.set_handles([af.Cuboid(LEFT, LEFT)])
    live.set_secondary_motion(af.SecondaryMotionOptions(**({"damping": 0.0} | dict(further))))
    return live


def held(samples, **options):
    """A bar of which one end is held."""
    return af.LiveDeformer(samples, [af.Cuboid(LEFT, LEFT)], af.LiveOptions(**(QUICK | options)))


def swung(live, seconds, rate):
    """(times, heights of the tip, total energies) at so many steps a second."""
    heights, energies = [live.field(TIP)[0, 2]], []
    for _ in range(round(seconds * rate)):
        heights.append(live.step([LEFT], 1 / rate)(TIP)[0, 2])
        energies.append(live.report.value + live.report.kinetic)
    return np.arange(len(heights)) / rate, np.array(heights), np.array(energies)


def period_of(times, heights):
    down = np.flatnonzero(heights[:-1] * heights[1:] < 0)
    crossings = times[down] - heights[down] * (times[1] - times[0]) / (heights[down + 1] - heights[down])
    assert len(crossings) >= 3
    return 2 * np.diff(crossings).mean()


def decay_of(times, energies):
    """How fast swings die down, 1/s: half the rate at which the total energy falls."""
    seen = np.flatnonzero(energies > SEEN * energies[0])
    return -0.5 * np.polyfit(times[1 + seen], np.log(energies[seen]), 1)[0]


def test_without_strength_steps_are_solves_bit_for_bit(samples):
    handles = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)]
    plain, stepped = (af.LiveDeformer(samples, handles, af.LiveOptions(**QUICK)) for _ in range(2))
    stepped.set_secondary_motion(af.SecondaryMotionOptions(strength=0.0, gravity=9.81))
    for angle in (5, 10, 40, 20):
        targets = [LEFT, turned(angle) @ RIGHT]
        assert np.array_equal(plain.solve(targets)(TIP), stepped.step(targets, 1 / 24)(TIP))
    assert plain.report.value == stepped.report.value and stepped.report.kinetic == 0.0


@pytest.mark.parametrize(("rate", "seconds"), [(24, 3.0), (240, 1.0)])
def test_the_total_energy_does_not_rise(samples, rate, seconds):
    live = released(samples)
    start, (_, _, energies) = live.report.value, swung(live, seconds, rate)
    assert energies.max() <= (1 + ENERGY_RISE) * start
    assert energies[-1] > 0.75 * start  # nor does the scheme eat it


def test_frame_rates_change_neither_period_nor_decay(samples):
    tops = {}
    for rate in (24, 60):
        times, heights, energies = swung(released(samples, further={"damping": 1.0}), 2.5, rate)
        tops[rate] = period_of(times, heights), decay_of(times, energies)
    assert tops[24][0] == pytest.approx(tops[60][0], rel=ALIKE)
    assert tops[24][1] == pytest.approx(tops[60][1], rel=ALIKE)
    assert tops[60][1] == pytest.approx(1.0, rel=DECAY)  # what was asked for


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.0, 2.0, 3.0])
def test_periods_hold_from_360_to_1500_centers_and_from_24_to_240_frames_a_second(damping):
    seconds, speeds = 2.4, []
    for fine, coarse, rate in ((300, 60, 24), (300, 60, 240), (1250, 250, 60)):
        size = {"samples": 6000, "fine_centers": fine, "coarse_centers": coarse}
        live = released(bar_samples(12000), further={"damping": damping}, **size)
        times, heights, energies = swung(live, seconds, rate)
        speeds.append((period_of(times, heights), decay_of(times, energies)))
    for (period, decay), alike in zip(speeds[1:], (ALIKE, FINER_ALIKE), strict=True):
        assert period == pytest.approx(speeds[0][0], rel=alike)
        # Without damping: of the amplitude as much is left.
        kept, first = (decay, speeds[0][1]) if damping else np.exp(-seconds * np.array([decay, speeds[0][1]]))
        assert kept == pytest.approx(first, rel=alike)


@pytest.mark.slow
def test_the_total_energy_does_not_rise_in_a_thousand_frames():
    live = released(bar_samples(6000), samples=2000, fine_centers=300, coarse_centers=60)
    _, _, energies = swung(live, 1000 / 24, 24)
    assert energies.max() <= (1 + ENERGY_RISE) * energies[0]


def test_the_same_steps_from_a_state_are_the_same_bits(samples):
    live = released(samples)
    swung(live, 0.25, 24)
    state = live.motion_state
    first = swung(live, 0.25, 24)[1]
    live.solve([turned(80) @ LEFT])
    live.motion_state = state
    assert np.array_equal(swung(live, 0.25, 24)[1], first)
    other = released(samples, threads=1)
    other.motion_state = state
    assert np.array_equal(swung(other, 0.25, 24)[1], first)


def test_gravity_bends_it_down_and_the_ground_holds_it(samples):
    live = held(samples)
    live.set_secondary_motion(af.SecondaryMotionOptions(gravity=20.0, damping=5.0))
    hanging = live.solve(None, iterations=200, tolerance=1e-6)(TIP)[0, 2]
    assert hanging < -0.1
    live.reset()
    for _ in range(60):
        moved = live.step(None, 1 / 24)
    assert moved(TIP)[0, 2] == pytest.approx(hanging, rel=ALIKE)  # where a solve says that it comes to rest
    assert live.report.speed < 0.05
    lowest = []
    for gravity in (20.0, 200.0):
        live.set_secondary_motion(af.SecondaryMotionOptions(gravity=gravity, damping=5.0), ground=-0.6)
        lowest += [live.step(None, 1 / 24)(samples.points)[:, 2].min() for _ in range(20)]
    assert min(lowest) > -0.6 - SUNK and lowest[-1] < -0.58


def test_handles_that_jump_do_not_tear_it(samples):
    live = held(samples)
    live.set_secondary_motion(af.SecondaryMotionOptions(damping=3.0))
    live.solve()
    for target in (turned(170) @ LEFT, turned(0, shift=(30, 0, 0)) @ LEFT, turned(-120, axis=0) @ LEFT):
        for _ in range(12):
            assert np.isfinite(live.step([target], 1 / 24)(samples.points)).all()
    for _ in range(72):
        live.step(None, 1 / 24)
    assert live.report.speed < 0.2 and live.report.energy < 0.01


def test_places_without_mass_follow_at_once(samples):
    masses = np.where(samples.points[:, 0] > 1.0, 1.0, 0.0)
    live = held(samples)
    live.set_secondary_motion(af.SecondaryMotionOptions(), masses=masses)
    live.solve()
    away = live.step([turned(0, shift=(0, 0, 0.3)) @ LEFT], 1 / 24)
    near, far = away(np.array([[-1.0, 0.0, 0.0]]))[0, 2], away(TIP)[0, 2]
    assert near > 0.2 and far < 0.2


def test_an_object_that_moves_drags_its_surface_along(samples):
    """The same motion, told by handles and by coordinates."""
    turn = turned(15.0, shift=(0.1, 0.0, 0.2))
    world, local = (held(samples) for _ in range(2))
    for live in (world, local):
        live.set_secondary_motion(af.SecondaryMotionOptions())
        live.solve()
    tip = world.step([turn @ LEFT], 1 / 24)(TIP)
    here = local.step([LEFT], 1 / 24, coordinates=np.linalg.inv(turn))(TIP)
    assert np.abs(here @ turn[:3, :3].T + turn[:3, 3] - tip).max() < 0.01
    assert np.abs(here - TIP).max() > 0.1


def test_what_cannot_be_is_named_and_nothing_moves(samples):
    live = released(samples)
    live.step(None, 1 / 24)
    state = live.motion_state
    options = af.SecondaryMotionOptions
    for call, name in (
        (lambda: live.set_secondary_motion(options(damping=-1.0)), "damping"),
        (lambda: live.set_secondary_motion(options(strength=float("nan"))), "strength"),
        (lambda: live.set_secondary_motion(options(), masses=np.zeros(len(samples.points))), "masses"),
        (lambda: live.set_secondary_motion(options(), masses=-np.ones(len(samples.points))), "masses"),
        (lambda: live.set_secondary_motion(options(), masses=np.ones(3)), "masses"),
        (lambda: live.set_secondary_motion(options(), up=np.zeros(3)), "up"),
        (lambda: live.set_secondary_motion(options(), ground=float("inf")), "ground"),
        (lambda: live.step(None, float("nan")), "seconds"),
        (lambda: live.step(None, 0.0), "seconds"),
        (lambda: live.step([handle_box([0, 0, 0], [np.nan] * 3)], 0.1), "targets"),
        (lambda: live.step(None, 0.1, coordinates=2.0 * np.eye(4)), "coordinates"),
    ):
        with pytest.raises(af.InvalidInput, match=name):
            call()
    other = af.LiveDeformer(
        samples, [af.Cuboid(LEFT, LEFT)], af.LiveOptions(**(QUICK | {"fine_centers": 40}))
    )
    with pytest.raises(af.InvalidInput, match="state"):
        other.motion_state = state
    assert np.array_equal(live.motion_state.coefficients, state.coefficients)
    assert np.array_equal(live.motion_state.velocities, state.velocities)


def test_a_cancelled_step_leaves_the_body_where_it_was(samples):
    live = released(samples)
    live.step(None, 1 / 24)
    state, task = live.motion_state, af.Task()
    timer = threading.Timer(0.1, task.cancel)
    timer.start()
    begun = time.monotonic()
    with pytest.raises(af.Cancelled):
        live.step([turned(40) @ LEFT], 10.0, task=task)
    assert time.monotonic() - begun < 2.0
    timer.join()
    assert np.array_equal(live.motion_state.coefficients, state.coefficients)
    assert np.array_equal(live.step(None, 1 / 24)(TIP), after(live, state))


def after(live, state):
    live.motion_state = state
    return live.step(None, 1 / 24)(TIP)


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_the_bodys_cotangents_are_those_of_its_formula(kind):
    rng = np.random.default_rng(3)
    jets, (rest, goal) = rng.normal(size=(10, 40, 3)).astype(kind), rng.normal(size=(2, 40, 3))
    masses, gravity = rng.uniform(size=40), np.array([0.3, -0.2, -2.0])

    def oracle(places):
        inertia = 3.5 * (torch.tensor(masses) * ((places - torch.tensor(goal)) ** 2).sum(1)).mean()
        return (
            inertia - (torch.tensor(masses) * ((places - torch.tensor(rest)) @ torch.tensor(gravity))).mean()
        )

    value, cotangents = testing.body_energy(jets, rest, goal, masses, 7.0, gravity)
    expected, gradient = gradient_of(lambda leaf: oracle(leaf[0]), jets.astype(np.float64))
    relative = FLOAT64_GRADIENT if kind is np.float64 else FLOAT32_ENERGY
    assert value == pytest.approx(expected, rel=relative)
    assert np.abs(cotangents - gradient).max() < relative * np.abs(gradient).max()
