# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights of bones that leave the shape, as importers of glTF's joints make them."""

import numpy as np
import pytest
from support.geometry.characters import HIP, LEG, Capsules, trousers

import arapfields as af

FEW = af.SkinOptions(poses=16, samples=2000)
ARMS = ("Arm.L", "Arm.R")
# Heads, and the tails of a rig made by hand.
CHEST, KNEES, FEET = 0.6, 0.3, 0.05
KNEE = 0.38  # of two legs
FOX = {
    "Spine": ((0, 0.4, 0.65), (0, -0.2, 0.65), None),
    "Head": ((0, -0.35, 0.7), (0, -0.8, 0.9), "Spine"),
}
for side, x in (("L", 0.1), ("R", -0.1)):
    FOX[f"Arm.{side}"] = ((x, -0.25, CHEST), (x, -0.25, KNEES), "Spine")
    FOX[f"Hand.{side}"] = ((x, -0.25, KNEES), (x, -0.25, FEET), f"Arm.{side}")
    FOX[f"Leg.{side}"] = ((x, 0.35, CHEST), (x, 0.35, FEET), "Spine")
NAMES = list(FOX)


def fox():
    """A body on four legs whose muzzle stands out over the front ones."""
    parts = [((0, 0.4, 0.65), (0, -0.3, 0.65), 0.14), ((0, -0.35, 0.7), (0, -0.8, 0.9), 0.09)]
    parts += [((x, y, CHEST), (x, y, FEET), 0.05) for x in (0.1, -0.1) for y in (-0.25, 0.35)]
    return af.extract_surface(Capsules(parts, af.Frame([0, -0.2, 0.5], 0.8)), 60)[:2]


def rig_of(tails):
    return [
        af.Bone(head, tails.get(name, tail), None if up is None else NAMES.index(up), name=name)
        for name, (head, tail, up) in FOX.items()
    ]


@pytest.fixture(scope="module")
def shape():
    return fox()


@pytest.fixture(scope="module")
def by_hand(shape):
    return af.skin_weights(shape, rig_of({}), FEW)


def share(weights, *bones):
    return weights[:, [NAMES.index(bone) for bone in bones]].sum(1)


def test_arms_with_tails_in_the_air_leave_the_muzzle_alone(shape, by_hand):
    """Their tails end below it, and the head's is as short as its neck, as importers make them."""
    tails = {name: (x, -0.75, 0.68) for name, x in zip(ARMS, (0.1, -0.1), strict=True)}
    tails["Head"] = (0, -0.37, 0.8)
    weights = af.skin_weights(shape, rig_of(tails), FEW)
    muzzle = shape[0][:, 1] < -0.5
    assert muzzle.sum() > 100
    assert share(weights[muzzle], *ARMS).max() < 0.05
    assert share(weights[muzzle], "Head").min() > 0.5
    assert np.abs(weights - by_hand).mean() < 0.02


@pytest.mark.parametrize("side", [1, -1])
def test_a_tail_that_enters_the_other_leg_does_not_pull_there(side):
    """Every bone's tail points to one side, as in files whose joints have no axes."""
    bones = [af.Bone((0, 0, HIP), (side * 0.05, 0, HIP + 0.5))]
    for x in (LEG, -LEG):
        for height in (HIP, KNEE):
            parent = 0 if height == HIP else len(bones) - 1
            bones.append(af.Bone((x, 0, height), (x + side * 2 * LEG, 0, height), parent))
    vertices, triangles = af.extract_surface(trousers(), 30)[:2]
    weights = af.skin_weights((vertices, triangles), bones, FEW)
    low = vertices[:, 2] < KNEE
    for x, others in ((1, [3, 4]), (-1, [1, 2])):
        leg = weights[low & (x * vertices[:, 0] > 0)]
        assert leg[:, others].sum(1).max() < 0.05
        assert leg[:, [5 - other for other in others]].sum(1).min() > 0.9
    thigh = (np.abs(vertices[:, 2] - 0.5) < 0.05) & (vertices[:, 0] > 0)
    assert weights[thigh, 1].min() > 0.6


def test_a_bone_outside_of_the_shape_moves_nothing(shape, by_hand):
    """Such as a pole target, and one whose tail alone is near."""
    outside = [
        af.Bone((0.1, -0.55, 0.3), (0.1, -0.6, 0.3), 0, name="Pole"),
        af.Bone((0, 0, 0), (0, 0, 0.1), None, name="Root"),
    ]
    weights = af.skin_weights(shape, [*rig_of({}), *outside], FEW)
    assert not weights[:, len(FOX) :].any()
    assert np.allclose(weights.sum(1), 1, atol=1e-5)
    assert np.abs(weights[:, : len(FOX)] - by_hand).mean() < 0.02


def test_a_tail_far_beyond_the_shape_changes_little(shape, by_hand):
    """Importers give the last joints bones of any length."""
    tails = {f"Hand.{side}": (x, -0.25, -20.0) for side, x in (("L", 0.1), ("R", -0.1))}
    weights = af.skin_weights(shape, rig_of(tails), FEW)
    assert np.abs(weights - by_hand).mean() < 0.01
