# SPDX-License-Identifier: GPL-3.0-or-later
"""Text as programs of Windows write it, with a byte order mark: read as if it had none."""

import json

import numpy as np
import pytest
from support.programs.cli import SMALL_SOLVE, run

from arapfields.cli.files import read_mesh, read_normals
from arapfields.cli.points import read_weights
from arapfields.cli.skinning import read_bones
from arapfields.cli.tracks import read_tracks
from arapfields.cli.wrapping import read_landmarks

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16")
HANDLES = {
    "handles": [
        {"type": "cuboid", "corners": [[None, None, None], [-0.9, None, None]]},
        {"type": "point", "rest": [1, 0.25, 0.25], "target": [1, 0.25, 0.75]},
    ]
}
BONES = [{"name": "Wurzel ä", "head": [0, 0, 0], "tail": [0, 0, 1]}]


def box():
    """A box of quads as an OBJ, whose very first line is a vertex."""
    corners = [(x, y, z) for x in (-1.0, 1.0) for y in (-0.25, 0.25) for z in (-0.25, 0.25)]
    faces = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    return "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {face}\n" for face in faces)


@pytest.mark.parametrize("encoding", ENCODINGS[1:])
def test_a_mesh_and_handles_are_read_whatever_marks_their_text(encoding, tmp_path):
    moved = []
    for name in (ENCODINGS[0], encoding):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "box.obj").write_text(box(), encoding=name)
        (folder / "pose.json").write_text(json.dumps(HANDLES), encoding=name)
        source, output = folder / "box.obj", folder / "out.obj"
        assert run("deform", source, "-o", output, "--handles", folder / "pose.json", *SMALL_SOLVE) == 0
        moved.append(read_mesh(output))
    assert np.array_equal(moved[0][0], moved[1][0]) and np.array_equal(moved[0][1], moved[1][1])
    assert np.abs(moved[0][0] - read_mesh(tmp_path / encoding / "box.obj")[0]).max() > 0.2


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_numbers_and_lists_are_read_whatever_marks_their_text(encoding, tmp_path):
    def written(name, text):
        (tmp_path / name).write_text(text, encoding=encoding)
        return tmp_path / name

    assert read_weights(written("weights.csv", "1,2\n3\n"), 3).tolist() == [1, 2, 3]
    assert read_normals(written("normals.csv", "0,0,2\n1,0,0\n")).tolist() == [[0, 0, 1], [1, 0, 0]]
    assert np.shape(read_landmarks(written("pairs.txt", "0 0 0 1 1 1\n"))) == (1, 2, 3)
    assert np.shape(read_landmarks(written("pairs.json", "[[[0, 0, 0], [1, 1, 1]]]"))) == (1, 2, 3)
    assert [bone.name for bone in read_bones(written("bones.json", json.dumps(BONES)))] == ["Wurzel ä"]
    walk = {"name": "nose", "type": "point", "rest": [0, 0, 1], "frames": [[0, 0, 1]]}
    tracks = {"fps": 24, "start": 1, "handles": [walk]}
    assert read_tracks(written("walk.json", json.dumps(tracks))).fps == 24
