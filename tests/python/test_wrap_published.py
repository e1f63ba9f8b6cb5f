# SPDX-License-Identifier: GPL-3.0-or-later
"""Wraps of published shapes onto each other, by at most eight rough landmarks and defaults."""

import numpy as np
import pytest
from support.geometry import wrap_cases as cases
from support.oracles.network import Network

import arapfields as af

PAIRS = ("shiba spot", "spot shiba", "bunny frog", "whale spot")
# Of the exact distances either way, in % of the target's diagonal: the mean, and what 95 % keep.
NEAR, NEARLY_ALL = 0.3, 1.5
CROSSING = 0.001  # of the triangles: the flow folds nothing, but triangles have edges as long as they have
# What the report tells, from the samples, of the mean distances between the surfaces themselves: long
# triangles cut corners about which the field goes.
TOLD = 0.1
UPRIGHT = 0.999  # share of samples with det J > 0

FACING = {"shiba": (1, 0, 0), "spot": (0, 1, 0), "bunny": (-1, 0, 0), "frog": (1, 0, 0), "whale": (0, -1, 0)}

pytestmark = pytest.mark.slow


def surface(data_dir, name, resolution=128):
    """The published function, and its surface's vertices and triangles."""
    layers = Network.published(data_dir / "neural_sdf" / f"{name}.pt").layers
    sdf = af.NeuralSdf.from_layers(*layers)
    return sdf, *af.extract_surface(sdf, resolution=resolution)


def nearest(points, place):
    return points[((points - place) ** 2).sum(1).argmin()]


def clicks(v, facing):
    """Rough places by name: feet, nose, tail, ears, as far as a shape of four legs has them."""
    ahead = np.array(facing, float)
    left = np.cross([0, 0, 1], ahead)
    along, aside, up = v @ ahead, v @ left, v[:, 2]
    low, middle = up < up.min() + 0.1 * np.ptp(up), np.median(aside)
    amid = (along[low].min() + along[low].max()) / 2
    marks = {"nose": v[along.argmax()], "tail": v[along.argmin()]}
    for side, sign in (("left", 1), ("right", -1)):
        for place, way in (("front", 1), ("hind", -1)):
            foot = low & ((along - amid) * way > 0) & ((aside - middle) * sign > 0)
            marks[f"{place} {side}"] = nearest(v, v[foot].mean(0) - [0, 0, 0.05])
        half = (aside - middle) * sign > 0.02
        marks[f"ear {side}"] = v[half][up[half].argmax()]
    return marks


def whale_clicks(v):
    """Fins stand for front feet, flukes for hind ones."""
    marks = {"nose": v[v[:, 1].argmin()], "tail": nearest(v, [0, 0.6, 0.05])}
    for side, sign in (("left", 1), ("right", -1)):
        fin = (v[:, 1] < 0.1) & (v[:, 0] * sign > 0.1)
        marks[f"front {side}"] = v[fin][v[fin][:, 2].argmin()]
        fluke = (v[:, 1] > v[:, 1].max() - 0.25) & (v[:, 0] * sign > 0)
        marks[f"hind {side}"] = v[fluke][(v[fluke][:, 0] * sign).argmax()]
    return marks


def landmarks(name, v):
    return whale_clicks(v) if name == "whale" else clicks(v, FACING[name])


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("pair", PAIRS)
def test_published_shapes_onto_each_other(data_dir, pair, seed):
    name, onto = pair.split()
    _, v, f = surface(data_dir, name)
    target, onto_v, onto_f = surface(data_dir, onto)
    here, there = landmarks(name, v), landmarks(onto, onto_v)
    pairs = [(here[place], there[place]) for place in here if place in there]
    field = af.wrap(af.sample_mesh(v, f), target, pairs, af.WrapOptions(seed=seed))
    wrapped = field(v)
    exact = cases.distances(wrapped, f, onto_v, onto_f, 20000)
    distances = field.report.to_target_mean, field.report.from_target_mean
    for (mean, most), reported in zip(exact, distances, strict=True):
        assert mean <= NEAR and most <= NEARLY_ALL
        assert abs(100 * reported - mean) <= TOLD
    assert cases.crossing_share(wrapped, f) <= CROSSING
    assert 1 - field.report.flipped_share >= UPRIGHT


def test_a_cow_moved_scaled_and_bent_is_found_again_without_landmarks(data_dir):
    _, v, f = surface(data_dir, "spot")
    target_v = cases.moved(v)
    field = af.wrap(af.sample_mesh(v, f), af.MeshSdf(target_v, f))
    (mean, _), (back, _) = cases.distances(field(v), f, target_v, f, 20000)
    assert max(mean, back) < 0.5 and not field.report.notes


def test_half_a_cow_leaves_the_other_half_its_shape(data_dir):
    _, v, f = surface(data_dir, "spot")
    grown = v * [1.05, 1.05, 1.1]
    half = f[v[f].mean(1)[:, 0] < 0]
    field = af.wrap(af.sample_mesh(v, f), af.MeshSdf(grown, half), [], af.WrapOptions(alignment="rigid"))
    other = v[v[:, 0] > 0.1]
    after = field(other)
    motion = af.rigid_motion(other, after)
    away = np.linalg.norm(other @ motion[:3, :3].T + motion[:3, 3] - after, axis=1).mean()
    assert away < 0.05 * np.linalg.norm(np.ptp(v, axis=0))
    assert field.report.matched_share < 0.75 and field.report.from_target_mean < 0.005


def test_unlike_shapes_without_landmarks_are_noted(data_dir):
    _, v, f = surface(data_dir, "whale")
    target, *_ = surface(data_dir, "spot")
    field = af.wrap(af.sample_mesh(v, f), target, [], af.WrapOptions(stages=1, iterations=1))
    assert any("not alike" in note for note in field.report.notes)
