# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: its verbs, bad input, texts, presets, and standard streams."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.geometry import meshes
from support.geometry.characters import FOOT, HIP, LEG, trousers
from support.programs.cli import (
    HELD_AND_SHIFTED,
    SMALL_FIT,
    SMALL_SOLVE,
    bad_meshes,
    process,
    run,
    wait_until_at_work,
    write_octahedron,
)

import arapfields as af
from arapfields.__main__ import main
from arapfields._options import options_of
from arapfields.cli import files
from arapfields.cli.files import read_mesh, read_normals, read_weights, write_mesh
from arapfields.cli.handles import build_handles, read_handles, read_tracks
from arapfields.cli.parser import parse
from arapfields.cli.skinning import read_bones
from arapfields.cli.wrapping import read_landmarks

# The command line's verbs on small and on real meshes.

SDF, FIELD, AGAIN = (f"{name}.safetensors" for name in ("sdf", "field", "again"))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a mesh, a coarse fit of it and a field."""
    folder = tmp_path_factory.mktemp("made")
    write_octahedron(folder / "mesh.obj")
    assert run("fit", folder / "mesh.obj", "-o", folder / SDF, "--quiet", *SMALL_FIT) == 0
    arguments = ["--save-field", folder / FIELD, *HELD_AND_SHIFTED, *SMALL_SOLVE, "--quiet"]
    assert run("deform", folder / "mesh.obj", *arguments) == 0
    return folder


@pytest.mark.parametrize(
    "verb", ["", "fit", "sample", "deform", "stylize", "wrap", "transfer", "skin", "extract", "warp", "grid"]
)
def test_help_has_examples(verb, capsys):
    assert run(*([verb] if verb else []), "--help") == 0
    text = capsys.readouterr().out
    assert f"arapfields {verb}" in text and ("examples:" in text) == bool(verb)


def test_every_option_is_a_flag(capsys):
    structures = {"fit": af.FitOptions, "deform": af.DeformOptions, "stylize": af.StylizeOptions}
    for verb, structure in {**structures, "wrap": af.WrapOptions}.items():
        run(verb, "--help")
        text = capsys.readouterr().out
        missing = [name for name in structure.fields if "--" + name.replace("_", "-") not in text]
        assert not missing


def test_fit_saves_the_library_s_result(made, tmp_path):
    report, again = tmp_path / "report.json", tmp_path / AGAIN
    assert run("fit", made / "mesh.obj", "-o", again, "--report", report, "--quiet", *SMALL_FIT) == 0
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    assert np.array_equal(af.NeuralSdf.load(again)(points), af.NeuralSdf.load(made / SDF)(points))
    assert json.loads(report.read_text())["iterations"] == 60


@pytest.mark.parametrize("source", ["mesh.obj", SDF])
@pytest.mark.parametrize("suffix", [".ply", ".npz", ".xyz"])
def test_sample(source, suffix, made, tmp_path, capsys):
    output = tmp_path / f"points{suffix}"
    assert run("sample", made / source, "-o", output, "--count", "300") == 0
    assert "300 points" in capsys.readouterr().out
    if suffix == ".npz":
        points, normals = (np.load(output)[name] for name in ("points", "normals"))
    elif suffix == ".xyz":
        points, normals = np.split(np.loadtxt(output), 2, axis=1)
    else:
        cloud = trimesh.load(output)
        raw = cloud.metadata["_ply_raw"]["vertex"]["data"]
        points = np.asarray(cloud.vertices)
        normals = np.stack([raw[name] for name in ("nx", "ny", "nz")], -1).reshape(-1, 3)
    assert points.shape == normals.shape == (300, 3)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0, abs=1e-6)
    if source == "mesh.obj":
        assert np.abs(points).sum(1) == pytest.approx(1.0, abs=1e-6)
        assert (np.sum(points * normals, 1) > 0).all()


def test_deformed_samples_follow_the_field(made, tmp_path):
    for name, extra in {"rest": [], "moved": ["--deformed-by", made / FIELD]}.items():
        assert run("sample", made / "mesh.obj", "-o", tmp_path / f"{name}.npz", "--count", "200", *extra) == 0
    rest, moved = (np.load(tmp_path / f"{name}.npz") for name in ("rest", "moved"))
    field = af.DeformationField.load(made / FIELD)
    assert np.array_equal(moved["points"], field(rest["points"]))
    # A normal stays orthogonal to the images of the tangents.
    tangent = np.cross(rest["normals"], [0.3, 0.5, 0.8])
    image = np.einsum("nij,nj->ni", field.jacobian(rest["points"]), tangent)
    assert np.abs(np.sum(image * moved["normals"], 1)).max() < 1e-9


def test_deform_writes_mesh_surface_field_and_report(made, tmp_path):
    outputs = ["--save-field", tmp_path / FIELD, "--surface", tmp_path / "surface.ply"]
    outputs += ["--report", tmp_path / "report.json", "--resolution", "24"]
    assert run("deform", made / SDF, *outputs, *HELD_AND_SHIFTED, *SMALL_SOLVE, "--quiet") == 0
    field = af.DeformationField.load(tmp_path / FIELD)
    vertices, _ = af.extract_surface(af.NeuralSdf.load(made / SDF), resolution=24)
    written = trimesh.load(tmp_path / "surface.ply", process=False)
    assert np.asarray(written.vertices) == pytest.approx(field(vertices), abs=1e-5)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["iterations"] == 15 and report["stretch"] == pytest.approx(field.report.stretch)


def test_extract_through_the_inverse(made, tmp_path):
    through = ["--through", "inverse", "--deformed-by", made / FIELD, "--resolution", "40", "--quiet"]
    assert run("extract", made / SDF, "-o", tmp_path / "even.ply", *through) == 0
    even = trimesh.load(tmp_path / "even.ply", process=False)
    sdf, field = af.NeuralSdf.load(made / SDF), af.DeformationField.load(made / FIELD)
    expected, triangles = af.extract_deformed(sdf, field, 40)
    assert np.asarray(even.vertices) == pytest.approx(expected, abs=1e-5)
    assert np.array_equal(even.faces, triangles)


def test_flags_and_handle_file_mean_the_same(made, tmp_path):
    described = [
        {"type": "cuboid", "corners": [[None, None, None], [None, None, -0.3]]},
        {
            "type": "cuboid",
            "corners": [[None, None, 0.3], [None, None, None]],
            "move": {"translate": [0.2, 0, 0]},
        },
    ]
    (tmp_path / "pose.json").write_text(json.dumps({"handles": described}))
    arguments = ["-o", tmp_path / "moved.obj", "--handles", tmp_path / "pose.json", *SMALL_SOLVE, "--quiet"]
    assert run("deform", made / "mesh.obj", *arguments) == 0
    arguments = ["-o", tmp_path / "warped.obj"]
    assert run("warp", made / FIELD, made / "mesh.obj", *arguments) == 0
    assert (tmp_path / "moved.obj").read_text() == (tmp_path / "warped.obj").read_text()


def test_handle_file_forms(tmp_path):
    turn = {"axis": [0, 0, 2], "degrees": 90}
    described = [
        {"type": "cuboid", "center": [1, 0, 0], "half_extents": [1, 2, 3], "rotation": turn},
        {"type": "cuboid", "center": [1, 0, 0], "half_extents": [1, 2, 3],
         "move": {"rotate": turn, "pivot": [0, 0, 0], "translate": [0, 0, 5]}, "weight": 2},
        {"type": "point", "rest": [0, 0, 0], "target": [1, 2, 3]},
    ]  # fmt: skip
    (tmp_path / "pose.json").write_text(json.dumps(described))
    box, moved, point = build_handles(read_handles(tmp_path / "pose.json"), np.zeros((2, 3)))
    assert box.rest @ [0, 1, 0, 1] == pytest.approx([-1, 0, 0, 1])
    assert box.motion == pytest.approx(np.eye(4))
    assert moved.motion @ [1, 0, 0, 1] == pytest.approx([0, 1, 5, 1])
    assert moved.weight == 2 and point.target == pytest.approx([1, 2, 3])


def test_obj_keeps_all_but_positions(made, tmp_path):
    text = (
        "# a comment\nmtllib paint.mtl\no one\nv 0 0 0.5 1 0 0\nv 0.5 0 0\nv 0.5 0.5 0\nv 0 0.5 0\nvt 0 1\n"
        "vn 0 0 1\nusemtl red\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf 1//1 2//1 3//1\n"
    )
    (tmp_path / "quad.obj").write_text(text)
    assert run("warp", made / FIELD, tmp_path / "quad.obj", "-o", tmp_path / "moved.obj") == 0
    lines = (tmp_path / "moved.obj").read_text().splitlines()
    kept = [line for line in lines if not line.startswith("v ")]
    assert kept == [
        "# a comment", "mtllib paint.mtl", "o one", "vt 0 1", "usemtl red", "f 1/1 2/1 3/1 4/1", "f 1 2 3"
    ]  # fmt: skip
    field = af.DeformationField.load(made / FIELD)
    numbers = [[float(c) for c in line.split()[1:]] for line in lines if line.startswith("v ")]
    assert numbers[0] == pytest.approx([*field([[0, 0, 0.5]])[0], 1, 0, 0], abs=1e-7)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".off", ".obj"])
def test_meshes_survive_writing_and_reading(suffix, tmp_path):
    vertices, triangles = files.read_mesh(write_octahedron(tmp_path / "cube.obj", quads=True))
    assert vertices.shape == (8, 3) and triangles.shape == (12, 3)
    files.write_mesh(tmp_path / f"again{suffix}", vertices, triangles)
    v, f = files.read_mesh(tmp_path / f"again{suffix}")
    assert v.shape == (8, 3) and f.shape == (12, 3)
    volume = np.linalg.det(v[f]).sum() / 6
    assert volume == pytest.approx(8.0)


def test_stylize_by_name_and_by_normals(made, tmp_path):
    (tmp_path / "axes.txt").write_text("1, 0, 0\n-2 0 0\n0 1 0\n0 -1 0\n0 0 1\n0 0 -1\n")
    cube = write_octahedron(tmp_path / "cube.obj", quads=True)
    results = []
    for style in (["--style", "cube"], ["--normals", tmp_path / "axes.txt"], ["--normals", cube]):
        report = tmp_path / "report.json"
        arguments = ["-o", tmp_path / "styled.obj", *style, "--strength", "0.8", "--report", report]
        assert run("stylize", made / "mesh.obj", *arguments, *SMALL_SOLVE, "--quiet") == 0
        results.append(json.loads(report.read_text())["preference"])
    assert results == pytest.approx([results[0]] * 3, rel=1e-4)


def test_extract_and_grid(made, tmp_path):
    assert run("extract", made / SDF, "-o", tmp_path / "s.ply", "--resolution", "24", "--quiet") == 0
    vertices, triangles = files.read_mesh(tmp_path / "s.ply")
    expected = af.extract_surface(af.NeuralSdf.load(made / SDF), resolution=24)
    assert np.array_equal(triangles, expected[1]) and vertices == pytest.approx(expected[0], abs=1e-6)
    assert run("grid", made / SDF, "-o", tmp_path / "grid.npz", "--resolution", "16", "--quiet") == 0
    grid = np.load(tmp_path / "grid.npz")
    assert grid["values"].shape == (17, 17, 17)


@pytest.mark.parametrize("name", ["spot.obj", "bunny.off", "rockerArm.obj"])
def test_real_meshes(name, data_dir, tmp_path):
    mesh = data_dir / "meshes" / name
    vertices, triangles = files.read_mesh(mesh)
    low, high = vertices.min(0), vertices.max(0)
    middle, size = (low + high) / 2, high - low
    below = ",".join(f"{c}" for c in [np.inf, middle[1] - 0.3 * size[1], np.inf])
    above = ",".join(f"{c}" for c in [-np.inf, middle[1] + 0.3 * size[1], -np.inf])
    handles = ["--box", "-inf,-inf,-inf", below, "--box", above, "inf,inf,inf", "--turn", "0,1,0", "20"]
    moved = tmp_path / "moved.ply"
    assert run("deform", mesh, "-o", moved, *handles, *SMALL_SOLVE, "--quiet") == 0
    assert (
        run("stylize", mesh, "-o", tmp_path / "styled.ply", "--style", "cube", *SMALL_SOLVE, "--quiet") == 0
    )
    assert run("sample", mesh, "-o", tmp_path / "points.ply", "--count", "500", "--quiet") == 0
    assert run("fit", mesh, "-o", tmp_path / SDF, "--quiet", *SMALL_FIT) == 0
    extraction = ["-o", tmp_path / "surface.ply", "--resolution", "24", "--quiet"]
    assert run("extract", tmp_path / SDF, *extraction) == 0
    v, f = files.read_mesh(moved)
    assert v.shape == vertices.shape and np.array_equal(f, triangles)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "moved.ply", "points.ply", SDF, "styled.ply", "surface.ply"
    ]  # fmt: skip


def test_a_progress_bar_is_drawn_only_on_a_terminal(made, tmp_path, capsys):
    arguments = ["deform", made / "mesh.obj", "-o", tmp_path / "a.obj", *HELD_AND_SHIFTED, *SMALL_SOLVE]
    assert run(*arguments) == 0
    printed = capsys.readouterr()
    assert printed.err == "" and printed.out.startswith("wrote ")
    command, environment = process(*arguments)
    assert "100%" in on_a_terminal(command, environment)
    assert on_a_terminal([*command, "--quiet"], environment) == ""


def on_a_terminal(command, environment):
    """What a command prints on stderr where that is a terminal of 100 columns."""
    import pty
    import termios

    try:
        terminal, side = pty.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminals here: {error}")
    termios.tcsetwinsize(side, (30, 100))
    running = subprocess.Popen(command, stderr=side, stdout=subprocess.DEVNULL, env=environment)
    os.close(side)
    text = b""
    try:
        while chunk := os.read(terminal, 4096):
            text += chunk
    except OSError:  # what Linux reports once the other side is closed
        pass
    assert running.wait(timeout=60) == 0
    return text.decode()


# Bad input on the command line: one line that names the culprit, exit code 2, no file left behind.

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
def test_an_unknown_flag_points_to_the_verb_s_help(extra, folder, capsys):
    line = refusal(capsys, "sample", "a.ply", "--output", "out.ply", extra)
    assert line == f"arapfields sample: unrecognized arguments: {extra} (see arapfields sample --help)\n"


# Text as programs of Windows write it, with a byte order mark: read as if it had none.

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


# The verb skin: weights for bones from a file.

TROUSER_BONES = [{"name": "Spine", "head": [0, 0, HIP], "tail": [0, 0, 1.2]}]
for side in (1, -1):
    ends = {"head": [side * LEG, 0, HIP], "tail": [side * LEG, 0, FOOT]}
    TROUSER_BONES.append({"name": f"Leg{side}", "parent": "Spine", **ends})


def test_skin_weights_equal_the_library_s(tmp_path):
    mesh, rig, output = (tmp_path / name for name in ("body.ply", "rig.json", "weights.npz"))
    write_mesh(mesh, *af.extract_surface(trousers(), 20)[:2])
    rig.write_text(json.dumps(TROUSER_BONES))
    flags = ["--poses", "8", "--samples", "1000", "--correctives", "2", "--quiet"]
    assert main(["skin", str(mesh), "--bones", str(rig), "-o", str(output), *flags]) == 0
    bones = [
        af.Bone(row["head"], row["tail"], 0 if "parent" in row else None, name=row["name"])
        for row in TROUSER_BONES
    ]
    options = af.SkinOptions(poses=8, samples=1000)
    with np.load(output) as found:
        assert np.array_equal(found["weights"], af.skin_weights(read_mesh(mesh), bones, options))
        assert found["bones"].tolist() == [row["name"] for row in TROUSER_BONES]
        assert found["corrective_offsets"].shape == (2, len(found["weights"]), 3)


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([{**TROUSER_BONES[0], "parent": "Nobody"}], "bone Spine: Nobody is not known"),
        ([{**TROUSER_BONES[0], "roles": 3}], "bone Spine: roles is not known"),
        ({"bones": TROUSER_BONES}, "a list of bones"),
        ([{"name": "Spine", "head": [0, 0]}], "bone Spine: tail: is missing"),
    ],
)
def test_bones_are_checked(tmp_path, capsys, rows, text):
    rig = tmp_path / "rig.json"
    rig.write_text(json.dumps(rows))
    assert main(["skin", "body.ply", "--bones", str(rig), "-o", str(tmp_path / "w.npz")]) == 2
    assert text in capsys.readouterr().err and [path.name for path in tmp_path.iterdir()] == ["rig.json"]


# `arapfields --describe`: what it says of a flag is what the parser does with it.


@pytest.fixture
def told(capsys):
    assert run("--describe") == 0
    return json.loads(capsys.readouterr().out)


def test_every_verb_and_option_is_described(told):
    assert told["program"] == "arapfields" and told["version"] == af.__version__
    assert told["exit_codes"]["2"] == "bad input or usage"
    verbs = {verb["name"]: verb for verb in told["verbs"]}
    assert {"fit", "deform", "stylize", "warp", "animate", "wrap", "transfer", "skin"} <= set(verbs)
    for verb in told["verbs"]:
        assert verb["summary"] and verb["examples"]
        assert all(one.startswith(f"arapfields {verb['name']} ") for one in verb["examples"])
        assert all(argument["help"] and "%%" not in argument["help"] for argument in verb["arguments"])
    for name, option in options_of("deform").items():
        (flag,) = (
            one for one in verbs["deform"]["arguments"] if one["name"] == f"--{name.replace('_', '-')}"
        )
        assert flag["default"] == option["default"] and flag["low"] == option["low"]
        assert flag["choices"] == (list(option["choices"]) if option["type"] == "enum" else None)
    flags = {one["name"]: one for one in verbs["stylize"]["arguments"]}
    assert flags["--style"]["one_of"] == ["--style", "--normals", "--style-object"]
    assert flags["--box"]["repeats"] and flags["--box"]["values"] == 2
    assert flags["--quiet"]["values"] == 0 and flags["input"]["flags"] == []


def values_of(flag):
    """Values that a flag takes, by its description."""
    count = 1 if flag["values"] is None else flag["values"]
    if flag["choices"]:
        return [flag["choices"][-1]] * count
    if flag["type"] in ("integer", "number"):
        return [str(flag["low"] or 1)] * count
    names = flag["metavar"] if isinstance(flag["metavar"], list) else [flag["metavar"]] * count
    return ["1/2" if flag["name"] == "--shard" else VALUES.get(name, "1,2,3") for name in names]


def test_calls_made_from_the_description_are_parsed(told):
    """Each flag alone, beside what the verb requires; what takes no value gets none."""
    checked = 0
    for verb in told["verbs"]:
        required = []
        for one in verb["arguments"]:
            if one["required"] and one["flags"]:
                required += [one["name"], *["x"] * (one["values"] or 1)]
            elif one["required"]:
                required += ["x"]
        chosen = next((one["one_of"] for one in verb["arguments"] if one["one_of"]), [])
        for one in verb["arguments"]:
            if not one["flags"] or one["name"] in ("--help", *required):
                continue
            given = ["--box", "0,0,0", "1,1,1"] if one["name"] in MOVES else []
            if chosen and one["name"] not in chosen:
                given += [chosen[0], "cube"]
            parse([verb["name"], *required, *given, one["name"], *values_of(one)])
            checked += 1
    assert checked > 200


VALUES = {"DEGREES": "30", "LENGTH": "1"}  # by their names in the description
MOVES = ("--turn", "--pivot", "--shift", "--scale", "--reach")  # of the last box


# Options that go together under a name, in scripts and at the command line.


def test_flags_override_a_preset(tmp_path):
    report = tmp_path / "report.json"
    write_octahedron(tmp_path / "mesh.obj")
    few = [*HELD_AND_SHIFTED, "--preset", "paper", *SMALL_SOLVE, "--quiet", "--report", report]
    assert run("deform", tmp_path / "mesh.obj", "-o", tmp_path / "moved.obj", *few) == 0
    assert json.loads(report.read_text())["iterations"] == 15
    field = af.DeformOptions.preset("paper")
    assert (field.field, field.optimizer, field.bending_unit) == ("neural", "adam", "cube")
    assert field.iterations != 15 and af.DeformOptions.preset("paper", iterations=15).iterations == 15
    assert af.StylizeOptions.preset("paper").keep_stance == 0.0
    assert af.FitOptions.preset("good") == af.FitOptions()
    with pytest.raises(af.InvalidInput, match="known are paper"):
        af.DeformOptions.preset("cloth")
    with pytest.raises(af.InvalidInput, match="unknown option 'x'"):
        af.DeformOptions.preset("paper", x=1)


# The command line without a console: standard streams that are missing, closed or broken stop no verb.

FIELD_FILE = "field.safetensors"
TRACK = {"type": "point", "rest": [0, 0, 1], "frames": [[0, 0, 1], [0, 0, 1.1]]}
TWO_BONES = [
    {"name": "a", "head": [0, 0, -1], "tail": [0, 0, 0]},
    {"name": "b", "head": [0, 0, 0], "tail": [0, 0, 1]},
]
ALL_VERBS = {
    "fit": ["ball.ply", "-o", "ball.safetensors", *SMALL_FIT],
    "sample": ["ball.ply", "-o", "points.ply", "--count", "100"],
    "deform": ["ball.ply", "-o", "out.ply", "--save-field", FIELD_FILE, *HELD_AND_SHIFTED, *SMALL_SOLVE],
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
def folder_of_inputs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ball = meshes.sphere(subdivisions=2)
    files.write_mesh(tmp_path / "ball.ply", *ball)
    files.write_mesh(tmp_path / "egg.ply", ball[0] * [1, 1, 1.2], ball[1])
    (tmp_path / "walk.json").write_text(json.dumps({"fps": 24, "handles": [TRACK]}))
    (tmp_path / "bones.json").write_text(json.dumps(TWO_BONES))
    return tmp_path


@pytest.mark.parametrize("verb", ALL_VERBS)
def test_a_verb_works_without_standard_streams(verb, folder_of_inputs, monkeypatch):
    if verb == "warp":
        arguments = ["--save-field", "kept.safetensors", *HELD_AND_SHIFTED, *SMALL_SOLVE, "--quiet"]
        assert run("deform", "ball.ply", *arguments) == 0
    before = set(os.listdir())
    for missing in (["stderr"], ["stdout", "stderr"]):
        for name in missing:
            monkeypatch.setattr(sys, name, None)
        assert run(verb, *ALL_VERBS[verb]) == 0
    assert set(os.listdir()) > before


def test_an_error_without_standard_error_goes_nowhere_else(folder_of_inputs, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stderr", None)
    assert run("sample", "none.ply", "-o", "points.ply") == 2
    monkeypatch.setattr(sys, "stderr", None)
    assert run("sample", "--bogus") == 2
    assert capsys.readouterr().out == ""


def test_a_closed_stream_stops_nothing(folder_of_inputs, monkeypatch):
    closed = open(os.devnull, "w")  # noqa: SIM115
    closed.close()
    monkeypatch.setattr(sys, "stderr", closed)
    monkeypatch.setattr(sys, "stdout", closed)
    assert run("sample", *ALL_VERBS["sample"]) == 0


@pytest.mark.skipif(os.name == "nt", reason="a shell of other systems")
@pytest.mark.parametrize("end", ["2>&-", ">&-", ">&- 2>&- <&-", ">/dev/full", ">/dev/full 2>/dev/full"])
def test_a_program_without_a_console_does_its_work(end, folder_of_inputs):
    write_octahedron(folder_of_inputs / "mesh.obj")
    command, environment = process("deform", "mesh.obj", "-o", "out.obj", *HELD_AND_SHIFTED, *SMALL_SOLVE)
    quoted = " ".join(f"'{word}'" for word in command)
    done = subprocess.run(["sh", "-c", f"{quoted} {end}"], env=environment, capture_output=True, text=True)
    assert done.returncode == 0 and "Traceback" not in done.stderr
    moved = files.read_mesh(folder_of_inputs / "out.obj")[0]  # nothing else was written into it
    assert moved.shape == (6, 3) and np.isfinite(moved).all()


def test_a_reader_that_went_away_stops_nothing(folder_of_inputs):
    command, environment = process("animate", *ALL_VERBS["animate"])
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(command, env=environment, stdout=writing, stderr=writing)
    finally:
        os.close(writing)
    assert done.returncode == 0 and (folder_of_inputs / "out.pc2").exists()
