# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights where limbs part: no leg moves the other, and nothing is cut."""

import numpy as np
from support.geometry.characters import HIP, Capsules

import arapfields as af

FEW = af.SkinOptions(poses=16, samples=2000)


def stout(cells):
    """A body of two short thick legs, and its bones."""
    parts = [((x, 0, 0.25), (x, 0, HIP), 0.1) for x in (0.15, -0.15)]
    parts += [((-0.15, 0, 0.75), (0.15, 0, 0.75), 0.2), ((0, 0, 0.75), (0, 0, 1.1), 0.2)]
    bones = [af.Bone((0, 0, HIP), (0, 0, 1.1))]
    bones += [af.Bone((x, 0, HIP), (x, 0, HIP - 0.1), 0) for x in (0.15, -0.15)]
    return *af.extract_surface(Capsules(parts, af.Frame([0, 0, 0.6], 0.8)), cells)[:2], bones


def test_the_other_legs_weight_fades_below_the_crotch():
    """A cut leaves a hook there when a leg is spread. Steepest slope measured 2026-11: 10; with a cut 18."""
    V, F, bones = stout(cells=60)
    weights = af.skin_weights((V, F), bones, FEW)
    ends = np.concatenate([F[:, :2], F[:, 1:], F[:, ::2]])
    lengths = np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1)
    long = lengths > 0.01  # of cells of 0.027
    assert (np.ptp(weights[ends[long]], axis=1) / lengths[long, None]).max() < 14


def steps(triangles, weights):
    """Largest change of a weight along each edge."""
    ends = np.concatenate([triangles[:, :2], triangles[:, 1:], triangles[:, ::2]])
    return np.abs(weights[ends[:, 0]] - weights[ends[:, 1]]).max(axis=1)


def test_few_influences_leave_no_cracks():
    """Neither where vertices take other bones than their neighbours, nor where some have a mirrored vertex.

    Largest step that three influences add, and 99.9 % of all steps: measured 2026-11 0.023 and 0.43; where
    each vertex chose for itself 0.045, where only twins counted both sides 0.60.
    """
    parts = [((0, 0, 0.6), (0, 0, 1.1), 0.2)]
    bones = [af.Bone((0, 0, 0.6), (0, 0, 0.85)), af.Bone((0, 0, 0.85), (0, 0, 1.15), 0)]
    for x in (0.15, -0.15):
        parts += [((x, 0, 0.25), (x, 0, 0.6), 0.11), ((x, 0, 1.0), (3 * x, 0, 1.0), 0.09)]
        bones += [af.Bone((x, 0, 0.55), (x, 0, 0.2), 0), af.Bone((x, 0, 1.0), (3.2 * x, 0, 1.0), 1)]
    aside = 0.004  # of the grid, a seventh of a cell
    V, F = af.extract_surface(Capsules(parts, af.Frame([aside, 0, 0.65], 0.8)), 60)[:2]
    few, many = (
        af.skin_weights((V, F), bones, af.SkinOptions(poses=16, samples=2000, influences=count))
        for count in (3, 12)
    )
    assert (steps(F, few) - steps(F, many)).max() < 0.035
    assert np.quantile(steps(F, few), 0.999) < 0.5


def test_stout_legs_stay_apart_and_a_cloak_behind_them_stays_one():
    """Of the other leg a stout one had 5 %; a cloak's middle has both."""
    V, F, bones = stout(cells=30)
    count = 15
    x, z = np.meshgrid(np.linspace(-0.2, 0.2, count), np.linspace(0.15, 0.6, count))
    cloak = np.column_stack([x.ravel(), np.full(count**2, 0.15), z.ravel()])
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    halves = [(0, count + 1, 1), (0, count, count + 1)]
    faces = np.concatenate([corner[:, None] + half for half in halves])
    body = af.skin_weights((V, F), bones, FEW)
    both = af.skin_weights((np.concatenate([V, cloak]), np.concatenate([F, faces + len(V)])), bones, FEW)
    for weights in (body, both[: len(V)]):
        assert weights[(V[:, 2] < 0.5) & (V[:, 0] > 0), 2].max() < 0.01
        assert weights[(V[:, 2] < 0.5) & (V[:, 0] < 0), 1].max() < 0.01
    middle = both[len(V) :].reshape(count, count, 3)[: count // 2, count // 2 - 1 : count // 2 + 2, 1:]
    assert middle.min() > 0.02
