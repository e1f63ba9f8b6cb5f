# SPDX-License-Identifier: GPL-3.0-or-later
"""What keeps a figure's stance: value and cotangents, what it is blind to, and what it does to a style."""

import numpy as np
import pytest
import torch
from support import tolerances
from support.geometry import cases
from support.oracles.energies import gradient_of

import arapfields as af
from arapfields._native import testing

LEAN = 20.0  # energies/stance.h, lean_weight


def figure(count=300, seed=0):
    """Points of a cloud that is taller than wide."""
    return np.random.default_rng(seed).normal(size=(count, 3)) * [0.3, 0.2, 0.5]


def oracle(jets, rest, stance):
    """The formula of energies/stance.h, in torch."""
    up, ground, ways = torch.tensor(stance.up), torch.tensor(stance.ground), jets[0] - torch.tensor(rest)
    rises = ways @ up
    uneven = rises - (ground * rises).sum() / ground.sum()
    even = ((ways - ways.mean(0)) ** 2).sum(1).mean()
    return stance.scale * (even + (ground * uneven**2).mean() + leaning(ways, torch.tensor(rest), up))


def leaning(ways, rest, up):
    """LEAN times the squared size and the squared turn about horizontal axes that is closest to the ways."""
    arms = rest - rest.mean(0)
    generators = torch.zeros(3, 3, 3, dtype=arms.dtype)  # [axis]: row vectors a ↦ axis × a
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        generators[axis, i, j], generators[axis, j, i] = 1, -1
    turned = torch.stack([(arms @ generator).reshape(-1) for generator in generators], 1)
    turn = torch.linalg.lstsq(turned, (ways - ways.mean(0)).reshape(-1, 1)).solution[:, 0]
    lean = turn - (turn @ up) * up
    return LEAN * (arms**2).sum(1).mean() * (lean @ lean)


@pytest.mark.parametrize("order", [1, 4, 10])
@pytest.mark.parametrize("up", [[0, 0, 1], [0.3, -2, 0.5]])
def test_value_and_cotangent_equal_autograd_and_differences(order, up):
    rng = np.random.default_rng(1)
    rest = figure()
    stance = testing.Stance(rest, up)
    jets = rng.normal(size=(order, len(rest), 3))
    value, cotangents = testing.stance_energy(jets, rest, stance, 0.7)
    expected, gradient = gradient_of(lambda leaf: oracle(leaf, rest, stance), jets)
    assert value == pytest.approx(expected, rel=tolerances.FLOAT64_GRADIENT)
    assert np.abs(cotangents - 0.7 * gradient).max() < tolerances.FLOAT64_GRADIENT * np.abs(gradient).max()
    assert not cotangents[1:].any()
    direction, step = rng.normal(size=jets.shape), 1e-3
    ends = [testing.stance_energy(jets + s * step * direction, rest, stance)[0] for s in (1, -1)]
    slope = (cotangents / 0.7 * direction).sum()
    assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(slope, rel=tolerances.DIFFERENCES)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_the_composition_equals_the_formula(dtype):
    rng = np.random.default_rng(2)
    rest = figure().astype(dtype)
    stance = testing.Stance(rest.astype(float), [0.1, 0.2, 1])
    jets = rng.normal(size=(4, len(rest), 3)).astype(dtype)
    kernel = testing.stance_energy(jets, rest, stance, 0.6)
    composed = testing.stance_energy(jets, rest, stance, 0.6, composed=True)
    tolerance = tolerances.COMPOSED if dtype is np.float64 else tolerances.FLOAT32_ENERGY
    assert composed[0] == pytest.approx(kernel[0], rel=tolerance)
    assert np.abs(composed[1] - kernel[1]).max() <= tolerance * np.abs(kernel[1]).max()


def test_translations_are_free_and_units_do_not_matter():
    rest = figure()
    moved = rest @ cases.turn([1, 2, 3], 20)[:3, :3].T

    def value(scale, shift):
        stance = testing.Stance(scale * rest, [0, 0, 1])
        return testing.stance_energy(np.ascontiguousarray(scale * moved + shift)[None], scale * rest, stance)[
            0
        ]

    first = value(1.0, 0.0)
    assert first > 0.01
    assert value(1.0, [3.0, -1.0, 2.0]) == pytest.approx(first, rel=1e-12)
    assert value(40.0, 0.0) == pytest.approx(first, rel=1e-12)


def test_the_ground_is_what_lies_lowest():
    rest = figure()
    for up in ([0, 0, 1], [0, 1, 0], [-1, 0, 0]):
        stance = testing.Stance(rest, up)
        heights = rest @ up
        low = heights < heights.min() + 0.05 * np.ptp(heights)
        assert (stance.ground[low] > 0).all() and not stance.ground[~low].any()
    flat = rest * [1, 1, 0]
    assert (testing.Stance(flat, [0, 0, 1]).ground > 0).all()
    for up in ([0, 0, 0], [np.nan, 0, 1]):
        with pytest.raises(af.InvalidInput, match="up"):
            testing.Stance(rest, up)


def stool(count=2000, seed=0):
    """Samples of an ellipsoidal body on three slanting legs."""
    rng = np.random.default_rng(seed)
    unit = rng.normal(size=(count, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    body, legs = unit[: count // 2], unit[count // 2 :]
    radii = np.array([0.5, 0.35, 0.25])
    points, normals = [body * radii + [0, 0, 0.9]], [body / radii]
    for i, part in enumerate(np.array_split(legs, 3)):
        lean = cases.turn([np.sin(2.1 * i), -np.cos(2.1 * i), 0], 20)[:3, :3]
        foot = np.array([0.09, 0.09, 0.45])
        points.append((part * foot) @ lean.T + [0.4 * np.cos(2.1 * i), 0.3 * np.sin(2.1 * i), 0.42])
        normals.append((part / foot) @ lean.T)
    normals = np.concatenate(normals)
    return af.SurfaceSamples(
        np.concatenate(points),
        normals / np.linalg.norm(normals, axis=1)[:, None],
        frame=af.Frame([0, 0, 0], 1.0),
    )


def way(field, samples):
    """Mean way of the samples other than a translation."""
    ways = field(samples.points) - samples.points
    return np.linalg.norm(ways - ways.mean(0), axis=1).mean()


@pytest.mark.parametrize("field", ["radial", "neural"])
def test_a_style_leaves_the_figure_where_it_stood(field):
    """More of the stance, less of a way; the style is seen nonetheless."""
    samples = stool()
    how = dict(field=field, iterations=60 if field == "radial" else 150, width=48, layers=3)
    free, held = (
        af.stylize(samples, "octahedron", af.StylizeOptions(keep_stance=k, **how)) for k in (0.0, 8.0)
    )
    before = af.gauss_preference(samples.normals, af.preferred_normals("octahedron")).mean()
    assert way(held, samples) < 0.75 * way(free, samples)
    assert held.report["preference"] > before + 0.6 * (free.report["preference"] - before)


def test_live_styles_keep_it_too_and_handles_take_its_place():
    samples = stool()
    ways = {}
    for keep in (0.0, 8.0):
        live = af.LiveDeformer(samples, options=af.LiveOptions(keep_stance=keep, bending=0.1, interior=False))
        live.set_style("octahedron")
        ways[keep] = way(live.solve(iterations=60), samples)
        live.set_style(None)
        live.solve(iterations=200, tolerance=1e-8)
        assert live.report["energy"] < 1e-4
    assert ways[8.0] < 0.75 * ways[0.0]
    top = cases.box([-1, -1, 0.8], [1, 1, 2])
    moved = [
        af.LiveDeformer(samples, [cases.moved(top)], af.LiveOptions(keep_stance=keep)) for keep in (0.0, 8.0)
    ]
    for live in moved:
        live.set_style("cube")
        live.solve(iterations=20)
    assert moved[0].report["value"] == moved[1].report["value"]


def test_up_is_where_the_head_is():
    """The same figure lying on its side, told so, is styled the same."""
    samples = stool()
    turn = cases.turn([1, 0, 0], 90)[:3, :3]
    lying = af.SurfaceSamples(
        samples.points @ turn.T, samples.normals @ turn.T, frame=af.Frame([0, 0, 0], 1.0)
    )
    options = af.StylizeOptions(field="radial", iterations=200)
    first = af.stylize(samples, "square pyramid", options)
    second = af.stylize(lying, "square pyramid", options, orientation=turn, up=turn @ [0, 0, 1])
    for field, s, up in ((first, samples, np.eye(3)[2]), (second, lying, turn[:, 2])):
        lowest = (s.points @ up).argmin()
        assert abs((field(s.points) - s.points)[lowest] @ up) < 1e-9
    assert second.report["preference"] == pytest.approx(first.report["preference"], abs=0.01)
    with pytest.raises(af.InvalidInput, match="up"):
        af.stylize(samples, "cube", options, up=[0, 0, 0])
