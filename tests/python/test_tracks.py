# SPDX-License-Identifier: GPL-3.0-or-later
"""Handle tracks that are damaged or do not fit: named, by file, handle and frame."""

import io
import json
import struct
import zipfile

import numpy as np
import pytest
from support.geometry.bar import LEFT, RIGHT, turned

import arapfields as af
from arapfields.cli.tracks import read_tracks

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
def test_what_is_wrong_with_json_is_named(content, text, tmp_path):
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
def test_what_is_wrong_with_arrays_is_named(arrays, text, tmp_path):
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
