# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights of figures built from closed parts that cut each other, as game characters are."""

import numpy as np
import pytest
from support.geometry import meshes
from support.geometry.parts import LEG, ellipsoid, figure

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
EYE = 0.05
for side, x in (("L", 1), ("R", -1)):  # as importers make them of a file's joints: as long as the head's bone
    BONES[f"Eye.{side}"] = ((0.15 * x, -0.27, 1.15), (0.15 * x, -0.27, 1.4), "Head")
NAMES = list(BONES)
BONES_OF_FIGURE = [
    af.Bone(head, tail, None if up is None else NAMES.index(up), name=n)
    for n, (head, tail, up) in BONES.items()
]


def dressed(count=24):
    """The figure with rings about its ankles that cut each other, buttons between its shoes, and eyes."""
    vertices, triangles, parts = figure(count)
    about, triangles_about = meshes.torus(LEG + 0.02, 0.03, count, count)
    for side, x in (("L", 1), ("R", -1)):
        for name, (points, faces) in {
            "ring": (np.add(about, (LEG * x, 0, 0.2)), triangles_about),
            "button": ellipsoid((0.01 * x, -0.2, 0.1), (0.03, 0.03, 0.03), count // 2),
            "eye": ellipsoid((0.15 * x, -0.27, 1.15), (EYE, EYE, EYE), count // 2),
        }.items():
            triangles = np.concatenate([triangles, faces + len(vertices)])
            vertices = np.concatenate([vertices, points])
            parts = np.concatenate([parts, [f"{name}.{side}"] * len(points)])
    return vertices, triangles, parts


@pytest.fixture(scope="module")
def skinned():
    vertices, triangles, parts = dressed()
    return vertices, parts, np.asarray(af.skin_weights((vertices, triangles), BONES_OF_FIGURE, OPTIONS))


def test_correctives_open_no_cracks_between_triangles_that_only_touch():
    vertices, triangles, _ = dressed(count=10)
    loose, alone = vertices[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)
    options = af.SkinOptions(poses=6, samples=1000, correctives=4)
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


@pytest.mark.parametrize(("side", "other"), ["LR", "RL"])
def test_rings_about_a_leg_go_with_it_on_both_sides_of_the_middle(skinned, side, other):
    vertices, parts, weights = skinned
    ring = weights[parts == f"ring.{side}"]
    across = vertices[parts == f"ring.{side}", 0] * (1 if side == "L" else -1) < -0.02
    assert across.any()
    assert share(ring, f"Foot.{other}", f"Leg.{other}").max() < 0.01
    assert share(ring, f"Foot.{side}", f"Leg.{side}").min() > 0.9


@pytest.mark.parametrize("side", "LR")
def test_a_small_part_between_limbs_goes_whole_with_one_bone(skinned, side):
    _, parts, weights = skinned
    button = weights[parts == f"button.{side}"]
    assert (button == button[0]).all()
    assert np.count_nonzero(button[0]) == 1


def test_a_part_goes_with_its_own_bones_alone(skinned):
    _, parts, weights = skinned
    trunk = weights[parts == "trunk"]
    assert share(trunk, "Arm.L", "Arm.R", "Leg.L", "Leg.R", "Head").max() == 0


@pytest.mark.parametrize("side", "LR")
def test_a_joint_in_the_middle_of_an_eye_turns_the_eye_alone(skinned, side):
    _, parts, weights = skinned
    assert share(weights[parts == f"eye.{side}"], f"Eye.{side}").min() == 1
    assert share(weights[parts == "head"], f"Eye.{side}").max() == 0
