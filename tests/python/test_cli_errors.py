# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input on the command line: one line that names the culprit, exit code 2, no file left behind."""

import json
import signal
import subprocess
from pathlib import Path

import pytest
from support.programs.cli import (
    HELD_AND_SHIFTED,
    SMALL_SOLVE,
    bad_meshes,
    process,
    run,
    wait_until_at_work,
    write_octahedron,
)

VERBS = {
    "fit": ["--output", "out.safetensors"],
    "sample": ["--output", "out.ply"],
    "deform": ["--output", "out.obj", "--save-field", "field.safetensors", *HELD_AND_SHIFTED],
    "stylize": ["--surface", "out.stl", "--style", "cube"],
    "extract": ["--output", "out.ply"],
    "grid": ["--output", "out.npz"],
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refusal(capsys, *arguments):
    """The one line that a refused call printed."""
    assert run(*arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1 and "Traceback" not in printed.err, printed.err
    return printed.err


def contents(folder):
    return sorted(str(path) for path in folder.rglob("*"))


@pytest.mark.parametrize("verb", VERBS)
def test_bad_files_are_named(verb, folder, data_dir, capsys):
    (folder / "bad").mkdir()
    paths = bad_meshes(folder / "bad", data_dir / "meshes" / "bunny.off")
    before = contents(folder)
    for path in paths:
        line = refusal(capsys, verb, path, *VERBS[verb])
        assert str(path) in line, (path, line)
    assert contents(folder) == before


@pytest.mark.parametrize("verb", ["fit", "sample", "deform", "extract", "grid"])
@pytest.mark.parametrize(
    "output", ["missing/out{}", "out.xyzw", "folder{}", "noextension"], ids=lambda name: name[:4]
)
def test_bad_outputs_are_refused_before_the_work(verb, output, folder, capsys):
    mesh = write_octahedron(folder / "mesh.obj")
    suffix = {"fit": ".safetensors", "grid": ".npz"}.get(verb, ".ply")
    (folder / f"folder{suffix}").mkdir()
    output = output.format(suffix)
    extra = HELD_AND_SHIFTED if verb == "deform" else []
    assert str(Path(output)) in refusal(capsys, verb, mesh, "--output", output, *extra)


@pytest.mark.parametrize(
    "arguments, culprit",
    [
        ([], "VERB"),
        (["bend"], "bend"),
        (["fit"], "input"),
        (["fit", "mesh.obj"], "--output"),
        (["fit", "mesh.obj", "-o", "a.safetensors", "--width", "wide"], "--width"),
        (["fit", "mesh.obj", "-o", "a.safetensors", "--width", "0"], "width"),
        (["fit", "mesh.obj", "-o", "a.safetensors", "--device", "abacus"], "device"),
        (["fit", "mesh.obj", "-o", "a.safetensors", "--colour", "1"], "--colour"),
        (["sample", "mesh.obj", "-o", "a.ply", "--count", "0"], "count"),
        (["sample", "mesh.obj", "-o", "a.ply", "--deformed-by", "none.safetensors"], "none.safetensors"),
        (["deform", "mesh.obj"], "--output"),
        (["deform", "mesh.obj", "-o", "a.obj"], "handles"),
        (["deform", "mesh.obj", "-o", "a.obj", "--shift", "1,0,0"], "--shift"),
        (["deform", "mesh.obj", "-o", "a.obj", "--point", "0,0", "1,1,1"], "--point"),
        (["deform", "mesh.obj", "-o", "a.obj", "--box", "1,0,0", "0,1,1"], "--box number 1"),
        (["deform", "mesh.obj", "-o", "a.obj", "--box", "0,0,0", "1,1,1", "--turn", "0,0,0", "9"], "axis"),
        (
            ["deform", "mesh.obj", "-o", "a.obj", "--box", "0,0,0", "1,1,1", "--turn", "0,0,1", "far"],
            "--turn",
        ),
        (["deform", "mesh.obj", "-o", "a.obj", *HELD_AND_SHIFTED, "--field", "magnetic"], "field"),
        (["stylize", "mesh.obj", "-o", "a.obj"], "--style"),
        (["stylize", "mesh.obj", "-o", "a.obj", "--style", "baroque"], "baroque"),
        (["stylize", "mesh.obj", "-o", "a.obj", "--style", "cube", "--strength", "7"], "strength"),
        (["stylize", "mesh.obj", "-o", "a.obj", "--normals", "none.txt"], "none.txt"),
        (["stylize", "mesh.obj", "-o", "a.obj", "--style", "cube", "--style-turn", "z", "9"], "--style-turn"),
        (["stylize", "mesh.obj", "-o", "a.obj", "--style", "cube", "--up", "0,0,0"], "--up"),
        (["stylize", "mesh.obj", "-o", "a.obj", "--style", "cube", "--up", "y"], "--up"),
        (["grid", "mesh.obj", "-o", "a.npz", "--resolution", "0"], "resolution"),
        (["warp", "mesh.obj", "mesh.obj", "-o", "a.obj"], "mesh.obj"),
    ],
)
def test_bad_arguments_are_named(arguments, culprit, folder, capsys):
    write_octahedron(folder / "mesh.obj")
    before = contents(folder)
    assert culprit in refusal(capsys, *arguments)
    assert contents(folder) == before


@pytest.mark.parametrize(
    "content, culprit",
    [
        ("{", "not JSON"),
        ("7", "handles"),
        ('{"handles": [3]}', "handles"),
        ('{"handles": []}', "lists no handle"),
        ('[{"type": "sphere"}]', "handles[0]: type is 'sphere'"),
        ('[{"type": "point", "rest": [0, 0, 0]}]', "handles[0]: 'target' is missing"),
        ('[{"type": "point", "rest": [0, 0], "target": [0, 0, 0]}]', "handles[0]"),
        ('[{"type": "point", "rest": [0, 0, 0], "target": [0, 0, 0], "colour": 1}]', "colour"),
        (
            '[{"type": "cuboid", "center": [0, 0, 0], "half_extents": [1, 0, 1]}]',
            "handles[0]: the box is empty",
        ),
        ('[{"type": "cuboid", "center": [0, 0, 0], "half_extents": [1, 1, 1], "move": {"spin": 1}}]', "spin"),
        ('[{"type": "cuboid", "rest": [[1, 0], [0, 1]]}]', "handles[0]"),
    ],
)
def test_bad_handle_files_are_named(content, culprit, folder, capsys):
    write_octahedron(folder / "mesh.obj")
    (folder / "pose.json").write_text(content)
    line = refusal(capsys, "deform", "mesh.obj", "-o", "a.obj", "--handles", "pose.json")
    assert "pose.json" in line and culprit in line


def test_handles_that_scale_are_named(folder, capsys):
    write_octahedron(folder / "mesh.obj")
    rest = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    target = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    (folder / "pose.json").write_text(json.dumps([{"type": "cuboid", "rest": rest, "target": target}]))
    assert "handles[0]" in refusal(capsys, "deform", "mesh.obj", "-o", "a.obj", "--handles", "pose.json")


def test_interrupt_cancels_and_leaves_nothing(folder):
    write_octahedron(folder / "mesh.obj")
    arguments = [
        "-o",
        "a.obj",
        *HELD_AND_SHIFTED,
        *SMALL_SOLVE,
        "--iterations",
        1000000,
        "--report",
        "r.json",
    ]
    command, environment = process("deform", "mesh.obj", *arguments)
    running = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        wait_until_at_work(running)
        assert running.poll() is None, running.stderr.read()
        running.send_signal(signal.SIGINT)
        _, printed = running.communicate(timeout=30)
    finally:
        running.kill()
    assert (running.returncode, printed) == (130, "arapfields deform: interrupted\n")
    assert contents(folder) == [str(folder / "mesh.obj")]


@pytest.mark.parametrize("extra", ["--bogus", "b.ply"])
def test_what_a_verb_does_not_know_points_to_its_own_help(extra, folder, capsys):
    line = refusal(capsys, "sample", "a.ply", "--output", "out.ply", extra)
    assert line == f"arapfields sample: unrecognized arguments: {extra} (see arapfields sample --help)\n"
