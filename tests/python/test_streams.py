# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line without a console: standard streams that are missing, closed or broken stop no verb."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from support.geometry import meshes
from support.programs.cli import HELD_AND_SHIFTED, SMALL_FIT, SMALL_SOLVE, process, run, write_octahedron

from arapfields.cli import files

FIELD = "field.safetensors"
TRACK = {"type": "point", "rest": [0, 0, 1], "frames": [[0, 0, 1], [0, 0, 1.1]]}
BONES = [
    {"name": "a", "head": [0, 0, -1], "tail": [0, 0, 0]},
    {"name": "b", "head": [0, 0, 0], "tail": [0, 0, 1]},
]
VERBS = {
    "fit": ["ball.ply", "-o", "ball.safetensors", *SMALL_FIT],
    "sample": ["ball.ply", "-o", "points.ply", "--count", "100"],
    "deform": ["ball.ply", "-o", "out.ply", "--save-field", FIELD, *HELD_AND_SHIFTED, *SMALL_SOLVE],
    "stylize": ["ball.ply", "-o", "out.ply", "--style", "cube", *SMALL_SOLVE],
    "wrap": ["ball.ply", "egg.ply", "--suggest", "pairs.json"],
    "transfer": ["egg.ply", "ball.ply", "egg.ply", "--places", "places.npz"],
    "skin": ["ball.ply", "--bones", "bones.json", "-o", "weights.npz", "--poses", "4"],
    "extract": ["ball.ply", "-o", "out.ply", "--resolution", "16"],
    "warp": ["kept.safetensors", "ball.ply", "-o", "out.ply"],
    "grid": ["ball.ply", "-o", "grid.npz", "--resolution", "8"],
    "animate": ["ball.ply", "--tracks", "walk.json", "-o", "out.pc2"],
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ball = meshes.sphere(subdivisions=2)
    files.write_mesh(tmp_path / "ball.ply", *ball)
    files.write_mesh(tmp_path / "egg.ply", ball[0] * [1, 1, 1.2], ball[1])
    (tmp_path / "walk.json").write_text(json.dumps({"fps": 24, "handles": [TRACK]}))
    (tmp_path / "bones.json").write_text(json.dumps(BONES))
    return tmp_path


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_works_without_standard_streams(verb, folder, monkeypatch):
    if verb == "warp":
        arguments = ["--save-field", "kept.safetensors", *HELD_AND_SHIFTED, *SMALL_SOLVE, "--quiet"]
        assert run("deform", "ball.ply", *arguments) == 0
    before = set(os.listdir())
    for missing in (["stderr"], ["stdout", "stderr"]):
        for name in missing:
            monkeypatch.setattr(sys, name, None)
        assert run(verb, *VERBS[verb]) == 0
    assert set(os.listdir()) > before


def test_an_error_without_standard_error_goes_nowhere_else(folder, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stderr", None)
    assert run("sample", "none.ply", "-o", "points.ply") == 2
    monkeypatch.setattr(sys, "stderr", None)
    assert run("sample", "--bogus") == 2
    assert capsys.readouterr().out == ""


def test_a_closed_stream_stops_nothing(folder, monkeypatch):
    closed = open(os.devnull, "w")  # noqa: SIM115
    closed.close()
    monkeypatch.setattr(sys, "stderr", closed)
    monkeypatch.setattr(sys, "stdout", closed)
    assert run("sample", *VERBS["sample"]) == 0


@pytest.mark.skipif(os.name == "nt", reason="a shell of other systems")
@pytest.mark.parametrize("end", ["2>&-", ">&-", ">&- 2>&- <&-", ">/dev/full", ">/dev/full 2>/dev/full"])
def test_a_program_without_a_console_does_its_work(end, folder):
    write_octahedron(folder / "mesh.obj")
    command, environment = process("deform", "mesh.obj", "-o", "out.obj", *HELD_AND_SHIFTED, *SMALL_SOLVE)
    quoted = " ".join(f"'{word}'" for word in command)
    done = subprocess.run(["sh", "-c", f"{quoted} {end}"], env=environment, capture_output=True, text=True)
    assert done.returncode == 0 and "Traceback" not in done.stderr
    moved = files.read_mesh(folder / "out.obj")[0]  # nothing else was written into it
    assert moved.shape == (6, 3) and np.isfinite(moved).all()


def test_a_reader_that_went_away_stops_nothing(folder):
    command, environment = process("animate", *VERBS["animate"])
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(command, env=environment, stdout=writing, stderr=writing)
    finally:
        os.close(writing)
    assert done.returncode == 0 and (folder / "out.pc2").exists()
