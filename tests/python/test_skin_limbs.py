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
