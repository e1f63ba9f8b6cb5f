# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb skin: weights for bones from a file."""

import json

import numpy as np
import pytest
from support.geometry.characters import FOOT, HIP, LEG, trousers

import arapfields as af
from arapfields.__main__ import main
from arapfields.cli.files import read_mesh, write_mesh

BONES = [{"name": "Spine", "head": [0, 0, HIP], "tail": [0, 0, 1.2]}]
for side in (1, -1):
    ends = {"head": [side * LEG, 0, HIP], "tail": [side * LEG, 0, FOOT]}
    BONES.append({"name": f"Leg{side}", "parent": "Spine", **ends})


def test_weights_are_those_of_the_library(tmp_path):
    mesh, rig, output = (tmp_path / name for name in ("body.ply", "rig.json", "weights.npz"))
    write_mesh(mesh, *af.extract_surface(trousers(), 20)[:2])
    rig.write_text(json.dumps(BONES))
    flags = ["--poses", "8", "--samples", "1000", "--correctives", "2", "--quiet"]
    assert main(["skin", str(mesh), "--bones", str(rig), "-o", str(output), *flags]) == 0
    bones = [
        af.Bone(row["head"], row["tail"], 0 if "parent" in row else None, name=row["name"]) for row in BONES
    ]
    options = af.SkinOptions(poses=8, samples=1000)
    with np.load(output) as found:
        assert np.array_equal(found["weights"], af.skin_weights(read_mesh(mesh), bones, options))
        assert found["bones"].tolist() == [row["name"] for row in BONES]
        assert found["corrective_offsets"].shape == (2, len(found["weights"]), 3)


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([{**BONES[0], "parent": "Nobody"}], "bone Spine: Nobody is not known"),
        ([{**BONES[0], "roles": 3}], "bone Spine: roles is not known"),
        ({"bones": BONES}, "a list of bones"),
        ([{"name": "Spine", "head": [0, 0]}], "bone Spine: tail: is missing"),
    ],
)
def test_bones_are_checked(tmp_path, capsys, rows, text):
    rig = tmp_path / "rig.json"
    rig.write_text(json.dumps(rows))
    assert main(["skin", "body.ply", "--bones", str(rig), "-o", str(tmp_path / "w.npz")]) == 2
    assert text in capsys.readouterr().err and [path.name for path in tmp_path.iterdir()] == ["rig.json"]
