# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb `wrap`, also with a sequence of scans."""

import json
import shutil
from unittest.mock import Mock

import numpy as np
import pytest
import trimesh
from support.geometry import wrap_cases as cases
from support.programs.cli import run

import arapfields as af
from arapfields.cli import frames as store
from arapfields.cli import wrapping
from arapfields.cli.wrapping import read_landmarks, write_landmarks

# The verb wrap.

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


def test_transfer_copies_the_template_s_data_to_the_scan(pair):
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


# The verb wrap with --sequence: a template that follows a scanned motion.

FLAGS = ["--sequence", "--alignment", "none", *SMALL]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder with a template, three frames of its motion, and caches into which they were wrapped."""
    folder = tmp_path_factory.mktemp("motion")
    (folder / "frames").mkdir()
    v, f = cases.figure(2)
    trimesh.Trimesh(v, f, process=False).export(folder / "template.obj")
    trimesh.Trimesh(v, f, process=False).export(folder / "scan.ply")
    for number in (10, 9, 11):  # by number, not by letter
        shape = cases.bend(v, 0.05 * (number - 9))
        trimesh.Trimesh(shape, f, process=False).export(folder / "frames" / f"scan{number}.ply")
    for name in ("motion.pc2", "motion.mdd"):
        assert run("wrap", folder / "template.obj", folder / "frames", "-o", folder / name, *FLAGS) == 0
    return folder


@pytest.fixture
def motion(tmp_path, whole):
    """A copy of the frames, and the call that wraps the template onto them."""
    frames = shutil.copytree(whole / "frames", tmp_path / "frames")
    for name in ("template.obj", "scan.ply"):
        shutil.copy(whole / name, tmp_path)
    return frames, lambda *given: run("wrap", tmp_path / "template.obj", *given, *FLAGS)


@pytest.fixture
def wrapped(tmp_path, whole, motion):
    """The same, and a copy of what wrapping them into motion.pc2 has left."""
    shutil.copy(whole / "motion.pc2", tmp_path)
    shutil.copytree(whole / ".motion.pc2.frames", tmp_path / ".motion.pc2.frames")
    return motion


def test_frames_of_a_motion_go_into_a_point_cache(tmp_path, motion, whole, capsys):
    (frames, wrap), cache, (v, f) = motion, tmp_path / "motion.pc2", cases.figure(2)
    with af.PointCacheReader(whole / "motion.pc2") as reader:
        found = [reader[k] for k in range(3)]
    for k in range(3):
        away = np.abs(af.MeshSdf(cases.bend(v, 0.05 * k), f)(found[k].astype(float)))
        assert away.mean() < 0.01 * np.linalg.norm(np.ptp(v, axis=0))
    for wrong, text in (
        ([tmp_path / "scan.ply", "-o", cache], "no folder of frames"),
        ([frames, "-o", tmp_path / "out"], "--output"),
        ([frames, "-o", cache, "--suggest", tmp_path / "x.json"], "--suggest: has no meaning"),
    ):
        assert wrap(*wrong) == 2
        assert text in " ".join(capsys.readouterr().err.split())


def wraps_counted(monkeypatch, stop_at=None):
    """Names of the frames that are wrapped from now on; Ctrl-C comes at one of them."""
    wrapped = []

    def with_progress(name, call, quiet):
        if name == stop_at:
            raise KeyboardInterrupt
        field = call(None)
        wrapped.append(name)
        return field

    monkeypatch.setattr(wrapping, "with_progress", with_progress)
    return wrapped


def test_a_motion_that_was_stopped_goes_on_as_if_it_had_not_been(
    tmp_path, motion, whole, monkeypatch, capsys
):
    (frames, wrap), cache = motion, tmp_path / "motion.pc2"
    first = wraps_counted(monkeypatch, stop_at="scan11")
    assert wrap(frames, "-o", cache) != 0 and first == ["scan9", "scan10"] and not cache.exists()
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(store, "lock", Mock(side_effect=BlockingIOError))
        capsys.readouterr()
        assert wrap(frames, "-o", cache) == 2 and "another wrap is at work" in capsys.readouterr().err
    second = wraps_counted(monkeypatch)
    assert wrap(frames, "-o", cache, "--threads", "1") == 0 and second == ["scan11"]
    assert cache.read_bytes() == (whole / "motion.pc2").read_bytes()


@pytest.mark.parametrize(("edited", "redone"), [("scan11", 1), ("scan10", 2), ("scan9", 3)])
def test_a_changed_frame_and_later_ones_are_wrapped_again(tmp_path, wrapped, edited, redone, monkeypatch):
    (frames, wrap), cache, elsewhere = wrapped, tmp_path / "motion.pc2", tmp_path / "elsewhere.pc2"
    kept = tmp_path / ".motion.pc2.frames"
    count = len(list(kept.iterdir()))
    v, f = cases.figure(2)
    trimesh.Trimesh(cases.bend(v, -0.05), f, process=False).export(frames / f"{edited}.ply")
    anew = wraps_counted(monkeypatch)
    assert wrap(frames, "-o", cache) == 0 and anew == ["scan9", "scan10", "scan11"][-redone:]
    anew.clear()
    assert wrap(frames, "-o", elsewhere) == 0 and len(anew) == 3
    assert cache.read_bytes() == elsewhere.read_bytes()
    assert len(list(kept.iterdir())) == count  # no frame stays that the cache does not have


def test_other_options_wrap_all_frames_anew(tmp_path, wrapped, monkeypatch):
    (frames, wrap), cache = wrapped, tmp_path / "motion.pc2"
    anew = wraps_counted(monkeypatch)
    assert wrap(frames, "-o", cache) == 0 and not anew
    assert wrap(frames, "-o", cache, "--seed", "3") == 0 and len(anew) == 3


def test_a_damaged_cache_of_a_motion_is_replaced(tmp_path, wrapped, monkeypatch):
    (frames, wrap), cache = wrapped, tmp_path / "motion.pc2"
    before = cache.read_bytes()
    for path in (tmp_path / ".motion.pc2.frames").glob("[0-9]*"):
        path.write_bytes(path.read_bytes()[:-40])
    anew = wraps_counted(monkeypatch)
    assert wrap(frames, "-o", cache) == 0 and len(anew) == 3 and cache.read_bytes() == before


@pytest.mark.parametrize("bad", ["scan9", "scan10", "scan11"])
def test_a_bad_frame_is_held_named_and_tried_again(tmp_path, motion, whole, bad, monkeypatch, capsys):
    (frames, wrap), cache = motion, tmp_path / "motion.mdd"
    good = (frames / f"{bad}.ply").read_bytes()
    (frames / f"{bad}.ply").write_text("no mesh")
    assert wrap(frames, "-o", cache) == 2
    assert f"1 of 3 failed: {bad}.ply" in " ".join(capsys.readouterr().err.split())
    with af.PointCacheReader(cache) as reader:
        shapes = [reader[k] for k in range(3)]
    held = ["scan9", "scan10", "scan11"].index(bad)
    stands_in = max(held - 1, 0) if held else 1
    assert np.array_equal(shapes[held], shapes[stands_in])
    assert not np.array_equal(shapes[held], shapes[3 - held - stands_in])
    again = wraps_counted(monkeypatch)
    assert wrap(frames, "-o", cache) == 2 and again == []
    (frames / f"{bad}.ply").write_bytes(good)
    assert wrap(frames, "-o", cache) == 0
    assert again == ["scan9", "scan10", "scan11"][held:]
    assert cache.read_bytes() == (whole / "motion.mdd").read_bytes()


def test_a_motion_without_a_good_frame_is_refused(tmp_path, motion, capsys):
    frames, wrap = motion
    for path in frames.iterdir():
        path.write_text("no mesh")
    assert wrap(frames, "-o", tmp_path / "motion.pc2") == 2
    assert "3 of 3 failed: scan9.ply" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "motion.pc2").exists()
