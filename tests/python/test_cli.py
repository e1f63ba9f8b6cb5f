# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line's verbs on small and on real meshes."""

import json
import os
import subprocess

import numpy as np
import pytest
import trimesh
from support.programs.cli import HELD_AND_SHIFTED, SMALL_FIT, SMALL_SOLVE, process, run, write_octahedron

import arapfields as af
from arapfields.cli import files
from arapfields.cli.handles import build_handles, read_handles

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


def test_fit_saves_what_the_library_makes(made, tmp_path):
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


def test_a_bar_is_drawn_on_a_terminal_alone(made, tmp_path, capsys):
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
