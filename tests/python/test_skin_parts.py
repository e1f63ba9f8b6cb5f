# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights of figures built from closed parts that cut each other, as game characters are."""

import numpy as np
import pytest
from support.geometry.parts import LEG, figure

import arapfields as af

OPTIONS = af.SkinOptions(poses=16, samples=4000)
HIP, ANKLE = 0.5, 0.15
# Head tail parent of each bone.
BONES = {
    "Spine": ((0, 0, HIP), (0, 0, 0.9), None),
    "Head": ((0, 0, 0.95), (0, 0, 1.2), "Spine"),
    "Arm.L": ((0.15, 0, 0.8), (0.5, 0, 0.8), "Spine"),
    "Arm.R": ((-0.15, 0, 0.8), (-0.5, 0, 0.8), "Spine"),
    "Leg.L": ((LEG, 0, HIP), (LEG, 0, ANKLE), "Spine"),
    "Leg.R": ((-LEG, 0, HIP), (-LEG, 0, ANKLE), "Spine"),
    "Foot.L": ((LEG, 0, ANKLE), (LEG, -0.25, 0.05), "Leg.L"),
    "Foot.R": ((-LEG, 0, ANKLE), (-LEG, -0.25, 0.05), "Leg.R"),
}
NAMES = list(BONES)
BONES_OF_FIGURE = [
    af.Bone(head, tail, None if up is None else NAMES.index(up), name=n)
    for n, (head, tail, up) in BONES.items()
]


@pytest.fixture(scope="module")
def skinned():
    vertices, triangles, parts = figure()
    return vertices, parts, np.asarray(af.skin_weights((vertices, triangles), BONES_OF_FIGURE, OPTIONS))


def test_correctives_open_no_cracks_between_triangles_that_only_touch():
    vertices, triangles, _ = figure(count=10)
    loose, alone = vertices[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)
    options = af.SkinOptions(poses=8, samples=2000, correctives=6)
    weights = af.skin_weights((loose, alone), BONES_OF_FIGURE, options)
    keys = af.skin_correctives(loose, alone, BONES_OF_FIGURE, weights, options)
    _, place = np.unique(loose, axis=0, return_inverse=True)
    for key in keys:
        offsets = np.asarray(key.offsets)
        _, first = np.unique(place, return_index=True)
        assert np.allclose(offsets, offsets[first][place.ravel()], atol=1e-9)


def share(weights, *bones):
    return weights[:, [NAMES.index(bone) for bone in bones]].sum(1)


def test_a_hollow_head_goes_with_its_bone_and_not_with_the_arms_below(skinned):
    vertices, parts, weights = skinned
    upper = np.isin(parts, ["head", "lining"]) & (vertices[:, 2] > 1.1)
    assert share(weights[upper], "Head").min() > 0.9
    assert share(weights[np.isin(parts, ["head", "lining"])], "Arm.L", "Arm.R").max() < 0.15


@pytest.mark.parametrize(("side", "other"), ["LR", "RL"])
def test_shoes_that_reach_into_each_other_stay_apart(skinned, side, other):
    _, parts, weights = skinned
    shoe = weights[parts == f"shoe.{side}"]
    assert share(shoe, f"Foot.{other}", f"Leg.{other}").max() < 0.01
    assert share(shoe, f"Foot.{side}", f"Leg.{side}").min() > 0.6
