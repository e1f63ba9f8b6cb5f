# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb wrap with --sequence: a template that follows a scanned motion."""

import shutil
from unittest.mock import Mock

import numpy as np
import pytest
import trimesh
from support.geometry import wrap_cases as cases
from support.programs.cli import run

import arapfields as af
from arapfields.cli import frames as store
from arapfields.cli import wrap_sequence

SMALL = ["--centers", "50", "--stages", "2", "--iterations", "5", "--samples", "1000", "--quiet"]


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

    monkeypatch.setattr(wrap_sequence, "with_progress", with_progress)
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
def test_a_changed_frame_is_wrapped_again_with_those_behind_it(
    tmp_path, wrapped, edited, redone, monkeypatch
):
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


def test_what_is_kept_of_a_motion_may_be_damaged(tmp_path, wrapped, monkeypatch):
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
