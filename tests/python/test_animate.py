# SPDX-License-Identifier: GPL-3.0-or-later
"""`arapfields animate`: each frame its own, the same by shards, after kills, in every format."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import trimesh
from support.files.caches import names
from support.files.full_disk import files_of_at_most
from support.geometry.bar import LEFT, RIGHT, turned
from support.geometry.meshes import sphere
from support.programs.cli import process, run

import arapfields as af
from arapfields._files import whole_file
from arapfields.cli.files import read_mesh
from arapfields.cli.frame_solver import STEPS, TOLERANCE
from arapfields.cli.usd import write_usd

FRAMES = 6
SAME = {"samples": 400, "coarse_centers": 10, "fine_centers": 40}
ONE_ULP = 2.0**-23  # of single precision, relative
SMALL = ["--samples", "400", "--coarse-centers", "10", "--fine-centers", "40", "--quiet"]
QUICK = ["--iterations", "6", "--tolerance", "1e-2", *SMALL]


def poses():
    """(FRAMES, 4, 4) of the bar's right end, which turns further from frame to frame."""
    return np.array([turned(12.0 * i) @ RIGHT for i in range(FRAMES)])


def tracks_of(right, **further):
    held = {"name": "held", "type": "cuboid", "rest": LEFT.tolist(), "frames": [LEFT.tolist()] * len(right)}
    moved = {"name": "moved", "type": "cuboid", "rest": RIGHT.tolist(), "frames": right.tolist()}
    return {"fps": 25, "start": 1, "handles": [held, moved], **further}


@pytest.fixture
def place(tmp_path):
    vertices, triangles = sphere(1.0, 2)
    trimesh.Trimesh(vertices * (2.0, 0.5, 0.5), triangles, process=False).export(tmp_path / "bar.ply")
    (tmp_path / "tracks.json").write_text(json.dumps(tracks_of(poses())))
    return tmp_path


def animate(place, output, *further, tracks="tracks.json", solve=QUICK):
    mesh = place / "bar.ply"
    return run("animate", mesh, "--tracks", place / tracks, "-o", place / output, *solve, *further)


def frames(path):
    with af.PointCacheReader(path) as cache:
        return np.array(list(cache))


def said(capsys):
    text = capsys.readouterr().err
    assert len(text.splitlines()) == 1, text
    return text


def test_each_frame_is_the_solve_of_its_own_pose(place):
    assert animate(place, "all.pc2", solve=SMALL) == 0
    baked = frames(place / "all.pc2")
    vertices, triangles = read_mesh(place / "bar.ply")
    handles = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)]
    options = af.LiveOptions(**SAME)
    for i in (4, 0, 2):
        live = af.LiveDeformer(af.sample_mesh(vertices, triangles, seed=0), handles, options)
        field = live.solve([LEFT, poses()[i]], iterations=STEPS, tolerance=TOLERANCE)
        assert np.array_equal(baked[i], field(vertices).astype(np.float32))
    assert np.abs(baked[0] - vertices).max() < 1e-6  # the first pose is that of rest
    assert np.abs(baked[-1] - vertices).max() > 0.5
    assert animate(place, "some.pc2", "--frames", "3", "4", solve=SMALL) == 0
    assert np.array_equal(frames(place / "some.pc2"), baked[2:4])
    with af.PointCacheReader(place / "some.pc2") as cache:
        assert cache.times.tolist() == [3.0, 4.0]
    assert names(place) == ["all.pc2", "bar.ply", "some.pc2", "tracks.json"]


def test_shards_in_any_order_make_the_same(place):
    assert animate(place, "one.pc2") == 0
    for number in (3, 1, 2):
        assert not (place / "parts.pc2").exists()
        assert animate(place, "parts.pc2", "--shard", f"{number}/3") == 0
    assert (place / "parts.pc2").read_bytes() == (place / "one.pc2").read_bytes()
    assert names(place) == ["bar.ply", "one.pc2", "parts.pc2", "tracks.json"]


@pytest.mark.slow
def test_a_killed_run_goes_on_where_it_was(place):
    long = tracks_of(np.array([turned(0.5 * i) @ RIGHT for i in range(20)]))
    (place / "long.json").write_text(json.dumps(long))
    mesh = place / "bar.ply"
    command, environment = process(
        "animate", mesh, "--tracks", place / "long.json", "-o", place / "long.pc2", *SMALL
    )
    running = subprocess.Popen(command, env=environment)
    store = place / ".long.pc2.frames"
    begin = time.monotonic()
    while not store.exists() or len(list(store.glob("0*"))) < 3:
        assert running.poll() is None and time.monotonic() - begin < 60
        time.sleep(0.005)
    running.send_signal(signal.SIGKILL)
    running.wait()
    solved = {path: path.stat().st_mtime_ns for path in store.glob("0*")}
    assert 3 <= len(solved) < 20 and not (place / "long.pc2").exists()
    assert (
        animate(place, "long.pc2", "--shard", "1/20", tracks="long.json", solve=SMALL) == 0
    )  # the first: there already
    assert {path: path.stat().st_mtime_ns for path in store.glob("0*")} == solved
    assert animate(place, "long.pc2", tracks="long.json", solve=SMALL) == 0
    assert animate(place, "again.pc2", tracks="long.json", solve=SMALL) == 0
    assert (place / "long.pc2").read_bytes() == (place / "again.pc2").read_bytes()
    assert not list(place.glob(".*"))


def test_frames_there_already_are_taken_and_others_are_not(place, capsys):
    def keep(shard):
        arguments = [place / "bar.ply", "--tracks", place / "tracks.json", "-o", place / "x.pc2"]
        assert run("animate", *arguments, *QUICK[:-1], "--shard", shard) == 0
        return capsys.readouterr().out

    assert "3 frames solved" in keep("1/2") and "3 of 6 to come" in keep("1/2")
    store = place / ".x.pc2.frames"
    cut = sorted(store.glob("0*"))[0]
    os.truncate(cut, 8)
    assert "1 frames solved" in keep("1/2")
    moved = poses()
    moved[4] = turned(50) @ RIGHT
    (place / "tracks.json").write_text(json.dumps(tracks_of(moved)))
    assert "1 frames solved" in keep("1/2")  # the one that has changed
    assert animate(place, "x.pc2", "--frames", "1", "2") == 0  # leaves the others
    said = keep("2/2")
    assert "3 frames solved" in said and "1 of 6 to come" in said  # the first went with the two written
    assert "wrote" in keep("1/2") and not store.exists()


def test_mdd_and_npz_tell_the_same(place):
    rest = np.array([LEFT, RIGHT, np.diag([1, 1, 1, 1.0])])
    top = np.eye(4)
    top[:3, 3] = rest[2, :3, 3] = [0, 0, 0.5]
    right = poses()
    moves = np.stack([np.repeat(LEFT[None], FRAMES, 0), right, np.repeat(top[None], FRAMES, 0)], 1)
    kinds = np.array(["cuboid", "cuboid", "point"])
    np.savez(place / "t.npz", fps=25.0, start=1, rest=rest, frames=moves, kinds=kinds, names=list("abc"))
    tracks = tracks_of(right)
    point = {"name": "c", "type": "point", "rest": [0, 0, 0.5], "frames": [[0, 0, 0.5]] * FRAMES}
    tracks["handles"].append(point)
    (place / "t.json").write_text(json.dumps(tracks))
    assert animate(place, "a.mdd", tracks="t.npz") == 0
    assert animate(place, "b.mdd", tracks="t.json") == 0
    assert (place / "a.mdd").read_bytes() == (place / "b.mdd").read_bytes()
    with af.PointCacheReader(place / "a.mdd") as cache:
        np.testing.assert_allclose(cache.times, np.arange(1, FRAMES + 1) / 25, rtol=ONE_ULP)


@pytest.mark.parametrize(
    "suffix",
    ["usdc", pytest.param("usda", marks=pytest.mark.slow), pytest.param("usd", marks=pytest.mark.slow)],
)
def test_usd_is_read_back(suffix, place):
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    geometry = pytest.importorskip("pxr.UsdGeom")
    assert animate(place, f"x.{suffix}", "--up-axis", "y") == 0
    assert animate(place, "x.pc2") == 0
    stage = usd.Stage.Open(str(place / f"x.{suffix}"))
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == 25
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1, FRAMES)
    assert geometry.GetStageUpAxis(stage) == "Y"
    mesh = geometry.Mesh(stage.GetDefaultPrim())
    assert mesh.GetPath() == "/bar"
    _, triangles = read_mesh(place / "bar.ply")
    assert np.array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), triangles)
    points = np.array([np.array(mesh.GetPointsAttr().Get(1 + i)) for i in range(FRAMES)])
    # As text a number has six or more digits.
    np.testing.assert_allclose(points, frames(place / "x.pc2"), atol=2e-6 if suffix == "usda" else 0)
    low, high = np.array(mesh.GetExtentAttr().Get(3))
    np.testing.assert_allclose([low, high], [points[2].min(0), points[2].max(0)], atol=2e-6)


def test_usd_without_its_package_is_named(place, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pxr", None)
    assert animate(place, "x.usda") == 2
    assert "pip install 'arapfields[usd]'" in said(capsys)


def test_what_was_there_stays_where_the_disk_is_full(place, monkeypatch, capsys):
    assert animate(place, "x.pc2") == 0
    before = (place / "x.pc2").read_bytes()
    full = shutil.disk_usage(place)._replace(free=1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: full)
    assert animate(place, "x.pc2", "--frames", "2", "3") == 1  # no bad input
    assert "No space left" in said(capsys)
    assert (place / "x.pc2").read_bytes() == before


def test_a_disk_that_is_full_for_usd_is_named(tmp_path):
    pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    path = tmp_path / "x.usdc"
    path.write_text("before")
    moves = np.random.default_rng(0).normal(size=(20, 5000, 3))
    with (
        pytest.raises(OSError, match="the disk may be full") as error,
        files_of_at_most(100_000),
        whole_file(path) as partial,
    ):
        write_usd(partial, np.array([[0, 1, 2]]), moves, fps=24, start=1, up="z")
    assert str(path) in str(error.value)
    assert (tmp_path / "x.usdc").read_text() == "before" and names(tmp_path) == ["x.usdc"]


@pytest.mark.parametrize(
    ("flags", "text"),
    [
        (["--frames", "5", "4"], "--frames: 5 to 4 holds no frame"),
        (["--frames", "0", "4"], "has 1 to 6"),
        (["--frames", "6", "7"], "has 1 to 6"),
        *[(["--shard", it], "is not I/N") for it in ("0/3", "4/3", "x", "2147483649/2147483650")],
    ],
)
def test_wrong_flags_are_named(flags, text, place, capsys):
    assert animate(place, "x.pc2", *flags) == 2
    assert text in said(capsys) and names(place) == ["bar.ply", "tracks.json"]


def test_secondary_motion_follows_frame_by_frame(place, capsys):
    animate(place, "still.pc2")
    animate(place, "swing.pc2", "--secondary", "--damping", "1")
    animate(place, "part.pc2", "--secondary", "--damping", "1", "--frames", "4", "6")
    still, swing = frames(place / "still.pc2"), frames(place / "swing.pc2")
    assert np.abs(swing[0] - still[0]).max() < 1e-3 < np.abs(swing[3] - still[3]).max()
    assert np.array_equal(frames(place / "part.pc2"), swing[3:])
    for further in (["--damping", "1"], ["--secondary", "--shard", "1/2"]):
        assert animate(place, "none.pc2", *further) != 0
        assert further[-2] in capsys.readouterr().err
