# SPDX-License-Identifier: GPL-3.0-or-later
"""Flags of contact in Blender without a window: real files in, real files out."""

import json

import pytest
from support.blender.inside import require_bpy
from support.geometry import meshes

from arapfields.cli.files import read_mesh


def write(path, vertices, triangles):
    import trimesh

    trimesh.Trimesh(vertices, triangles, process=False).export(path)
    return path


def test_flags_of_contact_hold_a_surface_back(command, tmp_path):
    require_bpy()
    ball, triangles = meshes.sphere(subdivisions=3)
    table = write(tmp_path / "table.ply", ball * [2, 2, 0.2] - [0, 0, 1.4], triangles)
    lower = {"type": "cuboid", "corners": [[None, None, None], [None, None, -0.3]]}
    lower["move"] = {"translate": [0, 0, -0.6]}
    upper = {"type": "cuboid", "corners": [[None, None, 0.6], [None, None, None]]}
    (tmp_path / "pose.json").write_text(json.dumps({"handles": [lower, upper]}))
    run = ["deform", "-i", write(tmp_path / "ball.ply", ball, triangles)]
    run += ["--handles", tmp_path / "pose.json", "--quiet", "--samples", 4000]
    lowest = []
    for flags in ([], ["--ground", -1.1], ["--obstacle", f"{table}:0.05"]):
        command(*run, "-o", tmp_path / "out.ply", *flags)
        lowest.append(read_mesh(tmp_path / "out.ply")[0][:, 2].min())
    assert lowest[0] < -1.3 and lowest[1:] == pytest.approx([-1.1, -1.15], abs=0.02)
    for flags, said in (
        (["--ground", "high"], "is no height"),
        (["--obstacle", "Nobody"], "no object of"),
        (["--obstacle", f"{table}:-1"], "negative"),
    ):
        done = command(*run, "-o", tmp_path / "no.ply", *flags, check=False)
        assert done.returncode == 2 and said in done.stderr
    assert not (tmp_path / "no.ply").exists()
