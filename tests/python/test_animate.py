# SPDX-License-Identifier: GPL-3.0-or-later
"""The verb `animate`, the tracks of handles that it reads, and the frames that it writes."""

import io
import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import time
import zipfile

import numpy as np
import pytest
import trimesh
from support.files.archives import files_of_at_most, names
from support.geometry.meshes import LEFT, RIGHT, sphere, turned
from support.programs.cli import process, run

import arapfields as af
from arapfields._files import lock, whole_file
from arapfields._native import InvalidInput
from arapfields.cli.animate import STEPS, TOLERANCE
from arapfields.cli.files import read_mesh
from arapfields.cli.frames import FrameStore
from arapfields.cli.handles import read_tracks
from arapfields.cli.usd import write_usd

# `arapfields animate`: each frame its own, the same by shards, after kills, in every format.

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


def test_each_frame_equals_a_solve_of_its_pose(place):
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


def test_matching_frames_on_disk_are_reused(place, capsys):
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


def test_a_full_disk_keeps_existing_output(place, monkeypatch, capsys):
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


# `arapfields animate` with Gaussian splats: a PLY file a frame.

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


def test_shards_write_the_same_file_for_each_frame(tmp_path):
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


# Two runs of `animate` on one output: the second says so, and ends well.

TWICE_FRAMES = 4
TWICE_QUICK = [
    "--iterations",
    "2",
    "--samples",
    "200",
    "--coarse-centers",
    "8",
    "--fine-centers",
    "20",
    "--threads",
    "1",
]


@pytest.fixture
def place_of_two(tmp_path):
    vertices, triangles = sphere(1.0, 2)
    trimesh.Trimesh(vertices * (2.0, 0.5, 0.5), triangles, process=False).export(tmp_path / "bar.ply")
    for name, step in (("tracks", 10.0), ("other", 12.0)):
        right = [(turned(step * i) @ RIGHT).tolist() for i in range(TWICE_FRAMES)]
        handles = [("held", LEFT, [LEFT.tolist()] * TWICE_FRAMES), ("moved", RIGHT, right)]
        told = [{"name": n, "type": "cuboid", "rest": r.tolist(), "frames": f} for n, r, f in handles]
        (tmp_path / f"{name}.json").write_text(json.dumps({"fps": 25, "start": 1, "handles": told}))
    return tmp_path


def flags(place, *further, tracks="tracks"):
    given = [place / "bar.ply", "--tracks", place / f"{tracks}.json", "-o", place / "x.pc2"]
    return "animate", *given, *TWICE_QUICK, *further


def other(arguments):
    """The command in another process, whose locks are its own: exit code, and what it says."""
    command, environment = process(*arguments)
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def test_the_second_of_two_says_so(place_of_two, capfd):
    store = place_of_two / ".x.pc2.frames"
    part = "--shard", "1/2"
    assert run(*flags(place_of_two, *part)) == 0  # leaves its frames, and what it was to make
    with open(store / "lock-1-2", "r+b") as file:
        lock(file)
        code, said = other(flags(place_of_two, *part))
        assert code == 0 and "another animate is at work on the same frames" in said
        code, said = other(flags(place_of_two, *part, tracks="other"))
        assert code == 2 and "another run, of other frames" in said
    capfd.readouterr()
    assert run(*flags(place_of_two)) == 0
    assert "wrote" in capfd.readouterr().out and not store.exists()


def test_a_run_that_fails_leaves_no_folder(tmp_path):
    store = FrameStore(tmp_path / "x.pc2", 3, b"")
    with pytest.raises(InvalidInput), store.only_run("1-1", []) as first:
        assert first
        raise InvalidInput("something")
    assert not list(tmp_path.iterdir())


def test_a_point_cache_is_read_from_several_threads(tmp_path):
    """Each answer is the sample that was asked for."""
    import threading

    from arapfields import PointCacheReader, PointCacheWriter

    with PointCacheWriter(tmp_path / "x.pc2", points=500, frames=40) as cache:
        for number in range(40):
            cache.write(np.full((500, 3), float(number)))
    wrong = []
    with PointCacheReader(tmp_path / "x.pc2") as cache:

        def read(first):
            for number in range(400):
                index = (first + 7 * number) % 40
                if not (cache[index] == index).all():
                    wrong.append(index)

        threads = [threading.Thread(target=read, args=(first,)) for first in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert not wrong


def test_a_foreign_file_among_the_frames_stays(place_of_two):
    store = place_of_two / ".x.pc2.frames"
    assert run(*flags(place_of_two, "--shard", "1/2")) == 0
    for name in ("notes.txt", "0000001-mine", "0000001-" + "x" * 32):
        (store / name).write_text("kept")
    assert run(*flags(place_of_two)) == 0
    left = {path.name for path in store.iterdir() if not path.name.startswith("lock")}
    assert left == {"notes.txt", "0000001-mine", "0000001-" + "x" * 32}


# Handle tracks that are damaged or do not fit: named, by file, handle and frame.

BOUNDS = np.array([[-2.0, -0.5, -0.5], [2.0, 0.5, 0.5]])


def handle(**changed):
    return {"name": "end", "type": "cuboid", "rest": RIGHT.tolist(), "frames": [RIGHT.tolist()] * 3} | changed


def tracks(*handles, **changed):
    return {"fps": 24, "handles": list(handles or [handle()])} | changed


def test_frames_are_numbered_and_boxes_may_be_open(tmp_path):
    held = {"type": "cuboid", "corners": [[None] * 3, [-1.5, None, None]], "frames": [np.eye(4).tolist()] * 3}
    (tmp_path / "t.json").write_text(json.dumps(tracks(handle(weight=2.0), start=-5)))
    read = read_tracks(tmp_path / "t.json")
    assert (read.fps, read.start, read.count) == (24.0, -5, 3)
    (end,) = read.handles(2, BOUNDS)
    assert np.array_equal(end.target, RIGHT) and end.weight == 2
    (tmp_path / "t.json").write_text(json.dumps(tracks(held)))
    with pytest.raises(af.InvalidInput, match=r"t\.json: frame 1, handle handles\[0\]: .*rigid"):
        read_tracks(tmp_path / "t.json").handles(0, BOUNDS)  # a matrix is where the box is, not how it moved


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "expected"),
        (tracks(fps=0), "fps must be above 0"),
        (tracks(fps=None), "fps is None"),
        (tracks(fps=True), "fps is True"),
        (tracks(fps=1e9), "fps"),
        (tracks(start=1.5), "start an integer"),
        (tracks(start=1e30), "start is"),
        (tracks(rate=24), "unknown key 'rate'"),
        ({"fps": 24, "handles": []}, "has no handle"),
        (tracks(3), r"handles\[0\]: an object"),
        (tracks(handle(name=3)), "name is no text"),
        (tracks(handle(frames=[])), "has no frame"),
        (tracks(handle(frames=None)), "end: 'frames' is missing"),
        (tracks(handle(frames=[[1, 2, 3]])), r"end: frames has shape \(1, 3\)"),
        (tracks(handle(frames=[[1], [2, 3]])), "end: frames"),
        (tracks(handle(frames=[np.full((4, 4), np.nan).tolist()])), "place 0 is NaN"),
        (tracks(handle(), handle(name="b", frames=[RIGHT.tolist()])), "frames differ: end 3, b 1"),
        (tracks(handle(target=RIGHT.tolist())), "'target' and 'move' are for single poses"),
        (tracks(handle(type="sphere", frames=[np.eye(4).tolist()])), "type is 'sphere'"),
        (tracks(handle(colour=3)), "unknown key 'colour'"),
        (tracks(handle(frames=[RIGHT.tolist(), (2 * RIGHT).tolist()])), "frame 2, handle end: "),
    ],
)
def test_errors_in_json_tracks_are_named(content, text, tmp_path):
    path = tmp_path / "t.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(af.InvalidInput, match=text) as error:
        read = read_tracks(path)
        for index in range(read.count):
            read.handles(index, BOUNDS)
    assert str(error.value).startswith(f"{path}: ")


def archive(**changed):
    rest = np.array([LEFT, RIGHT])
    frames = np.stack([np.array([LEFT, turned(20.0 * i) @ RIGHT]) for i in range(3)])
    return {"fps": 24.0, "rest": rest, "frames": frames} | changed


@pytest.mark.parametrize(
    ("arrays", "text"),
    [
        ({"fps": 24.0, "rest": np.zeros((1, 4, 4))}, "has no array 'frames'"),
        (archive(frames=np.zeros((3, 1, 4, 4))), "shapes"),
        (archive(rest=np.zeros((2, 4, 4), complex)), "numbers of shapes"),
        (archive(names=np.array(["a"])), "names has shape"),
        (archive(kinds=np.array(["cuboid", "sphere"])), "type is 'sphere'"),
        (archive(fps=np.array([24.0, 25.0])), "single numbers"),
        (archive(fps="fast"), "fps is 'fast'"),
        (archive(extra=np.zeros(3)), "unknown array 'extra'"),
        (archive(names=np.array(["a", None])), "does not fit"),  # objects are never unpickled
        (archive(frames=np.full((3, 2, 4, 4), np.inf)), "NaN or infinite"),
    ],
)
def test_errors_in_array_tracks_are_named(arrays, text, tmp_path):
    path = tmp_path / "t.npz"
    np.savez(path, **arrays)
    with pytest.raises(af.InvalidInput, match=text) as error:
        tracks = read_tracks(path)
        for index in range(tracks.count):
            tracks.handles(index, BOUNDS)
    assert str(error.value).startswith(f"{path}: ")


def test_archives_that_promise_too_much_or_are_cut_off(tmp_path):
    path = tmp_path / "t.npz"
    np.savez_compressed(path, **archive())
    assert read_tracks(path).count == 3
    whole = path.read_bytes()
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000, 4, 4), }"
    header = header.ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("frames.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header)
    with pytest.raises(af.InvalidInput, match="does not fit its content"):
        read_tracks(path)
    for content in (b"", whole[:100], whole[:-30], io.BytesIO(whole).read(200) + whole[260:]):
        path.write_bytes(content)
        with pytest.raises(af.InvalidInput, match=r"t\.npz: "):
            read_tracks(path)
