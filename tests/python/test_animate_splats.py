# SPDX-License-Identifier: GPL-3.0-or-later
"""`arapfields animate` with Gaussian splats: a PLY file a frame."""

import json

import numpy as np
from support.geometry.bar import LEFT, RIGHT, turned
from support.geometry.meshes import sphere
from support.programs.cli import run

import arapfields as af

FRAMES = 6
SOLVE = [
    "--coarse-centers",
    "10",
    "--fine-centers",
    "40",
    "--iterations",
    "6",
    "--tolerance",
    "1e-2",
    "--quiet",
]


def test_each_frame_is_a_file_whichever_shard_makes_it(tmp_path):
    vertices, triangles = sphere(1.0, 2)
    samples = af.sample_mesh(vertices * (2.0, 0.5, 0.5), triangles, 600)
    one = np.ones((len(samples), 1))
    colours = one[:, :, None] * [1, 0, 0]
    scan = af.GaussianSplats(
        samples.points, one * [1, 0, 0, 0], one * [0.02, 0.02, 0.01], 0.9 * one[:, 0], colours
    )
    scan.save(tmp_path / "scan.ply")
    frames = [(turned(12.0 * i) @ RIGHT).tolist() for i in range(FRAMES)]
    held = {"name": "held", "type": "cuboid", "rest": LEFT.tolist(), "frames": [LEFT.tolist()] * FRAMES}
    moved = {"name": "moved", "type": "cuboid", "rest": RIGHT.tolist(), "frames": frames}
    (tmp_path / "tracks.json").write_text(json.dumps({"fps": 25, "start": 1, "handles": [held, moved]}))
    given = ["animate", tmp_path / "scan.ply", "--tracks", tmp_path / "tracks.json", *SOLVE]
    assert run(*given, "-o", tmp_path / "walk.ply") == 0
    made = sorted(tmp_path.glob("walk.*"))
    assert [path.name for path in made] == [f"walk.{number:04d}.ply" for number in range(1, FRAMES + 1)]
    rest, *_, fifth, last = (af.GaussianSplats.load(path) for path in made)
    right = samples.points[:, 0] > 1.8
    assert np.abs(rest.centers - scan.centers).max() < 0.02
    assert np.linalg.norm(last.centers[:600] - scan.centers, axis=1)[right].min() > 0.3
    assert np.abs(last.rotations[:600][right, 0]).max() < 0.95
    assert run(*given, "-o", tmp_path / "part.ply", "--shard", "2/3") == 0
    assert [path.name for path in sorted(tmp_path.glob("part.*"))] == ["part.0002.ply", "part.0005.ply"]
    assert np.array_equal(af.GaussianSplats.load(tmp_path / "part.0005.ply").centers, fifth.centers)
    assert run(*given, "-o", tmp_path / "walk.pc2") != 0
