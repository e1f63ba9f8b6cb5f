# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb wrap."""

import json

import numpy as np
import pytest
import trimesh
from support.geometry import wrap_cases as cases
from support.programs.cli import run

import arapfields as af
from arapfields.cli.wrapping import read_landmarks, write_landmarks

SMALL = ["--centers", "50", "--stages", "2", "--iterations", "5", "--samples", "1000", "--quiet"]

# In the largest motion: edges carry it, each by the mean Jacobian of its ends; 66 vertices tell it roughly.
THERE_AND_BACK = 0.02
COARSE = 0.15  # of a key's length, off on average: what 66 vertices leave


@pytest.fixture
def pair(tmp_path):
    v, f = cases.figure(2)
    target = cases.moved(v)
    trimesh.Trimesh(v, f, process=False).export(tmp_path / "template.obj")
    trimesh.Trimesh(target, f, process=False).export(tmp_path / "scan.ply")
    rows = [(v[i], target[i]) for i in (0, 1, 20, 50)]
    (tmp_path / "pairs.json").write_text(json.dumps(np.array(rows).tolist()))
    np.savetxt(tmp_path / "pairs.txt", np.array(rows).reshape(-1, 6))
    np.save(tmp_path / "pairs.npy", np.array(rows))
    return tmp_path


@pytest.mark.parametrize("landmarks", ["json", "txt", "npy"])
def test_a_mesh_goes_onto_another(pair, landmarks):
    arguments = [
        "-o",
        pair / "out.obj",
        "--save-field",
        pair / "wrap.safetensors",
        "--report",
        pair / "r.json",
    ]
    flags = ["--landmarks", pair / f"pairs.{landmarks}", *SMALL]
    assert run("wrap", pair / "template.obj", pair / "scan.ply", *arguments, *flags) == 0
    out, scan = (trimesh.load(pair / name, process=False) for name in ("out.obj", "scan.ply"))
    report = json.loads((pair / "r.json").read_text())
    away = np.abs(af.MeshSdf(scan.vertices, scan.faces)(out.vertices)).mean()
    assert away < 0.01 * report["diagonal"]
    assert len(report["landmarks"]) == 4 and report["to_target_mean"] < 0.01
    template = trimesh.load(pair / "template.obj", process=False)
    field = af.DeformationField.load(pair / "wrap.safetensors")
    assert np.abs(field(template.vertices) - out.vertices).max() < 1e-4


def test_landmarks_are_suggested(pair):
    meshes, found = (pair / "template.obj", pair / "scan.ply"), pair / "found.csv"
    assert run("wrap", *meshes, "--suggest", found, *SMALL) == 0
    pairs = np.array(read_landmarks(found))
    assert pairs.shape == (8, 2, 3)
    for suffix in (".json", ".npy", ".txt"):
        again = pair / f"again{suffix}"
        write_landmarks(again, suffix, pairs)
        assert np.array_equal(read_landmarks(again), pairs)


def test_a_folder_is_done_once_and_a_bad_file_stops_no_other(pair, capsys):
    scans, out = pair / "scans", pair / "out"
    scans.mkdir()
    (pair / "scan.ply").rename(scans / "a.ply")
    v, f = cases.figure(2)
    trimesh.Trimesh(v, f, process=False).export(scans / "b.ply")
    (scans / "c.ply").write_text("no mesh")
    (scans / "d.ply").mkdir()
    call = ["wrap", pair / "template.obj", scans, "-o", out, *SMALL[:-1]]
    assert run(*call) == 2
    said = capsys.readouterr()
    assert "2 of 4 failed: c.ply" in " ".join(said.err.split())
    (scans / "c.ply").unlink()
    (scans / "d.ply").rmdir()
    times = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    assert sorted(path.name for path in times) == ["a.json", "a.obj", "b.json", "b.obj", "sheet.html"]
    lines = [line for line in said.out.splitlines() if "size off" in line]
    shares = [float(line.split(": ")[1].split("%")[0]) for line in lines]
    assert len(shares) == 2 and shares == sorted(shares, reverse=True)
    assert run(*call) == 0 and {path: path.stat().st_mtime_ns for path in out.iterdir()} == times
    assert run(*call, "--seed", "3", "--shard", "2/2") == 0
    anew = {path.name for path in times if path.stat().st_mtime_ns != times[path]}
    assert anew == {"b.json", "b.obj", "sheet.html"}
    assert (out / "sheet.html").read_text().count("<figure>") == 2
    assert run(*call, "--landmark", "0,0,0", "0,0,0") == 2
    np.savetxt(pair / "stiff.txt", np.linspace(1, 5, len(v)))
    before = (out / "a.obj").stat().st_mtime_ns
    assert run(*call, "--weights", pair / "stiff.txt") == 0
    assert (out / "a.obj").stat().st_mtime_ns != before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "no output"),
        (["--suggest", "found.json", "--report", "r.json"], "--report: give --output"),
        (["-o", "out.obj", "--landmarks", "gone.json"], "gone.json"),
        (["-o", "out.obj", "--landmarks", "bad.json"], "pairs of places"),
        (["-o", "out.obj", "--landmark", "99,0,0", "0,0,0"], "landmarks[0]"),
        (["-o", "out.obj", "--closeness", "-1"], "closeness"),
    ],
)
def test_bad_input_is_named_and_nothing_is_written(pair, arguments, said, capsys, monkeypatch):
    monkeypatch.chdir(pair)
    (pair / "bad.json").write_text("[[1, 2, 3]]")
    assert run("wrap", "template.obj", "scan.ply", *arguments, "--quiet") == 2
    assert said in capsys.readouterr().err
    assert not (pair / "out.obj").exists()


def test_transfer_gives_the_scan_what_the_template_has(pair):
    v, f = cases.figure(2)
    scan = trimesh.load(pair / "scan.ply", process=False)
    trimesh.Trimesh(cases.moved(v), f, process=False).export(pair / "wrapped.obj")
    trimesh.Trimesh(1.1 * v, f, process=False).export(pair / "fat.obj")
    np.savez(pair / "weights.npz", weights=np.eye(len(v))[:, :5])
    meshes = [pair / name for name in ("wrapped.obj", "template.obj", "scan.ply")]
    assert run("transfer", *meshes, "--quiet") == 2
    flags = ["--keys", pair / "fat.obj", "--into", pair / "keys", "--places", pair / "places.npz", "--quiet"]
    flags += ["--values", pair / "weights.npz", "--values-output", pair / "out.npz"]
    assert run("transfer", *meshes, *flags) == 2  # there is no such folder
    (pair / "keys").mkdir()
    assert run("transfer", *meshes, *flags) == 0
    fat = trimesh.load(pair / "keys" / "fat.ply", process=False)
    away = np.linalg.norm(fat.vertices - cases.moved(1.1 * v), axis=1)
    assert away.mean() < COARSE * np.linalg.norm(fat.vertices - scan.vertices, axis=1).mean()
    with np.load(pair / "places.npz") as places, np.load(pair / "out.npz") as values:
        assert places["distances"].max() < 1e-4
        corners = np.einsum("nk,nkj->nj", places["shares"], cases.moved(v)[f[places["triangles"]]])
        assert np.abs(corners - scan.vertices).max() < 1e-4
        assert np.abs(values["weights"] - np.eye(len(v))[:, :5]).max() < 1e-3
        assert run("transfer", *meshes, "--places", pair / "places.json", "--quiet") == 0
        read = json.loads((pair / "places.json").read_text())
        assert all(np.array_equal(read[name], places[name]) for name in ("triangles", "shares", "distances"))
    back = [*flags[:-4], "--back"]
    back[back.index(pair / "fat.obj")] = pair / "keys" / "fat.ply"
    assert run("transfer", *meshes, *back) == 0
    again = trimesh.load(pair / "keys" / "fat.obj", process=False)
    assert np.abs(again.vertices - 1.1 * v).max() < THERE_AND_BACK * np.abs(0.1 * v).max()
