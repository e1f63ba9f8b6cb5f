# SPDX-License-Identifier: GPL-3.0-or-later
"""Files: saved fields and distances, damage, names, and the one writer for all outputs."""

import copy
import io
import json
import os
import re
import stat
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy
from support.blender.inside import require_bpy
from support.files import archives
from support.files.archives import files_of_at_most, random_motion, write_cache
from support.geometry.cases import bar_handles, bar_samples
from support.programs.cli import (
    HELD_AND_SHIFTED,
    SMALL_FIT,
    SMALL_SOLVE,
    process,
    run,
    wait_until_at_work,
    write_octahedron,
)

import arapfields as af
from arapfields._files import read_arrays, whole_file, write_arrays, write_text
from arapfields._native import OutputFile
from arapfields.grids import save_grid
from arapfields.point_cache import PointCacheReader

# Saved fields, signed distances and archives: their layout, damage, and names of files and folders.

# Saved fields and signed distances: the layout of safetensors, and a reader that trusts nothing.


def refusal(path, content=None):
    """What the reader says of a file that it must refuse."""
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(af.InvalidInput) as error:
        archives.load(path)
    assert str(error.value).startswith(f"{path}: "), error.value
    return str(error.value)


NAMES = ["sdf", "neural", "exact", "refined", "invertible", "composed", "radial", "embedded"]


@pytest.mark.parametrize("name", NAMES)
def test_any_reader_of_safetensors_opens_them(name, examples):
    texts, arrays = archives.read(examples[name])
    loaded = safetensors.numpy.load_file(examples[name])
    assert loaded.keys() == arrays.keys()
    assert all(np.array_equal(loaded[key], arrays[key]) for key in arrays)
    with safetensors.safe_open(examples[name], "np") as file:
        assert file.metadata()["format"] == "arapfields" and file.metadata()["version"] == "4"
    assert texts["kind"] == ("sdf" if name == "sdf" else "field")


@pytest.mark.parametrize("name", NAMES)
def test_a_loaded_file_is_saved_unchanged(name, examples, tmp_path):
    archives.load(examples[name]).save(tmp_path / "again")
    assert (tmp_path / "again").read_bytes() == examples[name].read_bytes()
    texts, arrays = archives.read(examples[name])
    shuffled = dict(reversed(arrays.items()))  # the order of arrays is the writer's own affair
    (tmp_path / examples[name].name).write_bytes(archives.packed(texts, shuffled))
    points = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    again = archives.load(tmp_path / examples[name].name)
    assert np.array_equal(again(points), archives.load(examples[name])(points))


def test_the_issues_lift_and_network(examples, tmp_path):
    """Arrays whose lengths disagree with each other or with what is declared: never in a kernel."""
    path = tmp_path / "embedded.safetensors"
    texts, arrays = archives.read(examples["embedded"])
    for name in ("embedding.values", "embedding.slopes", "embedding.nodes", "radii", "coefficients"):
        assert name in refusal(path, archives.packed(texts, {**arrays, name: arrays[name][:-1]}))
    slopes = {**arrays, "embedding.slopes": np.ascontiguousarray(arrays["embedding.slopes"][:, :6])}
    assert "embedding.slopes" in refusal(path, archives.packed(texts, slopes))
    for width, reason in {
        0: "width",
        -1.0: "width",
        1e400: "not JSON",
        None: "width",
        "wide": "width",
    }.items():
        changed = copy.deepcopy(texts)
        changed["structure"]["embedding"]["width"] = width
        assert reason in refusal(path, archives.packed(changed, arrays))
    texts, arrays = archives.read(examples["neural"])
    for member, value, reason in [
        ("width", 8192, "layers.0.weight"),
        ("layers", 64, "layers.1.weight"),
        ("octaves", 32, "layers.0.weight"),
        ("width", 10**15, "network.width"),
        ("width", 8.5, "network.width"),
    ]:
        changed = copy.deepcopy(texts)
        changed["structure"]["network"][member] = value
        assert reason in refusal(tmp_path / "neural.safetensors", archives.packed(changed, arrays))


HEADERS = [  # what is wrong with the header, and the header
    ("does not begin with an object", b"[1, 2]"),
    ("not JSON", b'{"a": '),
    ("nested deeper", b'{"a": ' + b"[" * 100000),
    ("twice", b'{"__metadata__": {"format": "a", "format": "b"}}'),
    ("'__metadata__' is missing", b"{}"),
    ("an object is needed", b'{"__metadata__": 3}'),
    ("a text is needed", b'{"__metadata__": {"format": 3}}'),
    ("does not begin with an object", b" {}"),
    ("ill-formed UTF-8", b'{"\xff": 1}'),
]


@pytest.mark.parametrize(("text", "header"), HEADERS, ids=[text for text, _ in HEADERS])
def test_bad_headers_are_refused(text, header, tmp_path):
    assert text in refusal(tmp_path / "x", archives.joined(header, b""))


def test_sizes_are_checked_before_memory_is_asked_for(examples, tmp_path):
    """The declared sizes are far beyond the file's; a reader that believed them would die."""
    texts, arrays = archives.read(examples["radial"])
    header = archives.header_of(texts, arrays)
    data = b"".join(a.tobytes() for a in arrays.values())
    entry = header["centers"]
    cases = {
        "large shape": {**entry, "shape": [10**9, 3]},
        "overflowing shape": {**entry, "shape": [2**40, 2**40, 2**40]},
        "negative shape": {**entry, "shape": [-1, 3]},
        "fractional shape": {**entry, "shape": [28.0, 3]},
        "many dimensions": {**entry, "shape": [1] * 1000},
        "beyond the file": {**entry, "data_offsets": [0, 10**12]},
        "backwards": {**entry, "data_offsets": [100, 0]},
        "overlapping": {**entry, "data_offsets": [8, 8 + arrays["centers"].nbytes]},
        "another dtype": {**entry, "dtype": "F16"},
        "unknown member": {**entry, "strides": [1, 2]},
        "a number": 7,
    }
    for name, changed in cases.items():
        refusal(tmp_path / name, archives.joined({**header, "centers": changed}, data))
    refusal(tmp_path / "more", archives.joined(header, data + b"12345678"))
    refusal(tmp_path / "cut", archives.joined(header, data[:-1]))
    refusal(tmp_path / "length", struct.pack("<Q", 2**63) + b"{}")
    declared = copy.deepcopy(texts)
    declared["structure"]["centers"] = 10**11
    refusal(tmp_path / "declared", archives.packed(declared, arrays))
    extra = {**arrays, "extra": np.zeros(3)}
    assert "extra" in refusal(tmp_path / "extra", archives.packed(texts, extra))
    lacking = {k: v for k, v in arrays.items() if k != "radii"}
    assert "radii" in refusal(tmp_path / "lacking", archives.packed(texts, lacking))
    broken = {**arrays, "centers": arrays["centers"] * np.nan}
    assert "NaN" in refusal(tmp_path / "nan", archives.packed(texts, broken))


@pytest.mark.parametrize(
    "change, word",
    [
        ({"format": "other"}, "format"),
        ({"version": "99"}, "newer release"),
        ({"version": "0"}, "version"),
        ({"version": "one"}, "version"),
        ({"kind": "sdf"}, "kind"),
        ({"report": "[]"}, "report"),
        ({"report": "{"}, "report"),
        ({"structure": "{}"}, "type"),
        ({"structure": "[" * 5000}, "nested"),
        ({"further": "x"}, "further"),
        ({"format": None}, "missing"),
    ],
)
def test_a_file_describes_its_contents(change, word, examples, tmp_path):
    texts, arrays = archives.read(examples["radial"])
    changed = {k: v for k, v in {**texts, **change}.items() if v is not None}
    assert word in refusal(tmp_path / "x", archives.packed(changed, arrays))


@pytest.mark.parametrize(
    "where, value",
    [
        (["type"], "cubic"),
        (["frame", "scale"], 0.0),
        (["frame", "scale"], -1.0),
        (["frame", "center"], [0, 0]),
        (["frame", "center"], [0, 0, "x"]),
        (["frame"], None),
        (["rest_points"], -1),
        (["network", "outputs"], 1),
        (["network", "frequency"], 0),
        (["network", "colour"], 1),
        (["handles"], 3),
        (["handles"], -1),
        (["base"], {}),
        (["base", "frame"], 7),
        (["colour"], 1),
        (["steps"], {}),
        (["steps"], 3),
        (["steps"], [3]),
        (["steps", 0], {}),
        (["steps", 0, "repeats"], 0),
        (["steps", 0, "repeats"], 10**9),
        (["steps", 0, "centers"], 10**11),
        (["steps", 0, "centers"], 1),
        (["steps", 0, "steps"], []),
    ],
)
def test_structures_that_do_not_fit(where, value, examples, tmp_path):
    name = {"handles": "exact", "steps": "composed"}.get(where[0], "refined")
    texts, arrays = archives.read(examples[name])
    part = texts["structure"]
    for key in where[:-1]:
        part = part[key]
    part[where[-1]] = value
    refusal(tmp_path / name, archives.packed(texts, arrays))


def test_foreign_files_and_places(examples, tmp_path):
    whole = examples["sdf"].read_bytes()
    halves = (whole[: len(whole) // 2], whole[:-4])
    for content in (b"", b"short", *halves, os.urandom(500), b"PK\3\4" + bytes(80)):
        refusal(tmp_path / "x", content)
    np.savez(tmp_path / "a.npz", a=1)
    refusal(tmp_path / "a.npz")
    if hasattr(os, "mkfifo"):  # on Windows pipes are no files
        os.mkfifo(tmp_path / "pipe")
        assert "regular file" in refusal(tmp_path / "pipe")
    for kind in (af.NeuralSdf, af.DeformationField):
        with pytest.raises(FileNotFoundError) as error:
            kind.load(tmp_path / "absent")
        assert error.value.filename == str(tmp_path / "absent")
        with pytest.raises(IsADirectoryError):
            kind.load(tmp_path)
        for path in (3, None, "", "a\0b", b"a\0b", object()):
            with pytest.raises(af.InvalidInput, match="path"):
                kind.load(path)
    name = "ÿ.safetensors".encode("latin-1" if os.name == "posix" else "utf-8")  # Windows' are Unicode
    odd = os.path.join(os.fsencode(tmp_path), name)
    sdf = af.NeuralSdf.load(examples["sdf"])
    sdf.save(odd)
    assert af.NeuralSdf.load(odd).frame == sdf.frame
    with open(odd, "wb") as file:
        file.write(b"nothing")
    with pytest.raises(af.InvalidInput):
        af.NeuralSdf.load(odd)


def test_reports_contain_only_json_values(examples, tmp_path):
    sdf = af.NeuralSdf.load(examples["sdf"])
    sdf._report = af.InverseReport(
        error_mean=float("inf"), error_max=np.float64(0.5), iterations=3, seconds=float("nan")
    )
    sdf.save(tmp_path / "x")
    read = af.NeuralSdf.load(tmp_path / "x").report
    assert np.isnan([read.error_mean, read.seconds]).all() and (read.error_max, read.iterations) == (0.5, 3)
    sdf._report = af.InverseReport(error_mean=object(), error_max=0.0, iterations=0, seconds=0.0)
    with pytest.raises(af.InvalidInput, match="report"):
        sdf.save(tmp_path / "y")
    assert not (tmp_path / "y").exists()
    assert json.loads(archives.read(tmp_path / "x")[0]["kind"] and "{}") == {}


# NumPy archives as files of poses, tracks and frames: what is damaged is refused, whatever NumPy raises.

ARRAYS = {"points": np.arange(30.0).reshape(10, 3), "name": np.array("bent"), "count": np.array(3)}


def written(compressed):
    stream = io.BytesIO()
    (np.savez_compressed if compressed else write_arrays)(stream, **ARRAYS)
    return stream.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_written_arrays_are_read(compressed, tmp_path):
    (tmp_path / "a.npz").write_bytes(written(compressed))
    for source in (written(compressed), tmp_path / "a.npz"):
        found = read_arrays(source, set(ARRAYS))
        assert found.keys() == ARRAYS.keys() and all((found[name] == ARRAYS[name]).all() for name in found)


@pytest.mark.parametrize("compressed", [False, True])
def test_every_damage_is_invalid_input_or_harmless(compressed):
    content, random, refused = written(compressed), np.random.default_rng(1), 0
    for at in range(len(content)):
        changed = bytearray(content)
        changed[at] ^= 1 << random.integers(8)
        for damaged in (bytes(changed), content[:at]):
            try:
                read_arrays(damaged)
            except af.InvalidInput as error:
                refused += 1
                assert str(error).startswith("the archive: ")
    assert refused > len(content)


def test_every_compression_is_read_or_refused():
    for method in range(100):
        changed = bytearray(written(True))
        for signature, offset in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
            at = changed.find(signature)
            while at >= 0:
                changed[at + offset] = method
                at = changed.find(signature, at + 1)
        if method != zipfile.ZIP_DEFLATED:
            with pytest.raises(af.InvalidInput):
                read_arrays(bytes(changed))


def test_sizes_of_arrays_are_checked_before_memory_is_asked_for():
    for shape in ((10**15,), (10**9, 10**9), (-1,), (2,)):
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive, archive.open("points.npy", "w") as entry:
            np.lib.format.write_array_header_1_0(
                entry, {"descr": "<f8", "fortran_order": False, "shape": shape}
            )
        with pytest.raises(af.InvalidInput, match="does not fit"):
            read_arrays(stream.getvalue())


def test_objects_and_other_names_are_refused(tmp_path):
    stream = io.BytesIO()
    np.savez(stream, points=np.array([{}], dtype=object))
    with pytest.raises(af.InvalidInput):
        read_arrays(stream.getvalue())
    with pytest.raises(af.InvalidInput, match="unknown array 'name'"):
        read_arrays(written(False), {"points", "count"})
    with pytest.raises(OSError):
        read_arrays(tmp_path / "none.npz")


# Damage that no reader of numbers sees: a flipped bit anywhere in a saved file is refused.

FLIPS = 60  # bits a kind of file


def test_each_flipped_bit_is_seen(examples, tmp_path):
    rng = np.random.default_rng(1)
    for name, path in examples.items():
        whole = path.read_bytes()
        for bit in rng.integers(0, 8 * len(whole), FLIPS):
            damaged = bytearray(whole)
            damaged[bit // 8] ^= 1 << bit % 8
            (tmp_path / path.name).write_bytes(damaged)
            with pytest.raises(af.InvalidInput):
                archives.load(tmp_path / path.name)
                pytest.fail(f"{name}: bit {bit} of {8 * len(whole)}")


def test_an_old_file_loads_and_a_new_one_needs_its_checksum(examples, tmp_path):
    path = tmp_path / "radial.safetensors"
    texts, arrays = archives.read(examples["radial"])
    path.write_bytes(archives.packed(texts, arrays))  # version 1
    points = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    assert np.array_equal(archives.load(path)(points), archives.load(examples["radial"])(points))
    header = archives.header_of(texts, arrays)
    for texts, message in (
        ({"version": "2"}, "checksum: it is missing"),
        ({"version": "2", "checksum": "12"}, "sixteen digits"),
    ):
        header["__metadata__"] |= texts
        path.write_bytes(archives.joined(header, b"".join(array.tobytes() for array in arrays.values())))
        with pytest.raises(af.InvalidInput, match=message):
            archives.load(path)


# Files in folders of any name: what is written is read again, by the library and by the command line.

# Windows has 260 characters for paths, but for programs that say they take more, as Python and Blender do.
FOLDERS = {
    "spaces": "my files",
    "umlauts": "Grüße Öl",
    "Chinese": "模型 文件",
    "long": "/".join(["x" * 60] * 5),
}


@pytest.fixture(params=FOLDERS)
def folder(request, tmp_path):
    path = tmp_path / FOLDERS[request.param]
    path.mkdir(parents=True)
    return path


def test_written_fields_are_read_again(folder):
    field = af.deform(bar_samples(300), bar_handles(), af.DeformOptions(iterations=3))
    field.save(folder / "ü 场.safetensors")
    points = bar_samples(50).points
    again = af.DeformationField.load(folder / "ü 场.safetensors")
    assert np.array_equal(again(points), field(points))
    motion = random_motion()
    with PointCacheReader(write_cache(folder / "é.pc2", motion)) as cache:
        assert np.array_equal(cache[1], motion[1])
    with pytest.raises(FileNotFoundError) as error:
        af.DeformationField.load(folder / "不.safetensors")
    assert "不.safetensors" in str(error.value)


def test_the_command_line_takes_them(folder):
    write_octahedron(folder / "ö.obj")
    given = ["--iterations", "3", "--samples", "500", "--style", "cube"]
    assert run("stylize", folder / "ö.obj", "-o", folder / "结果.ply", *given) == 0
    assert (folder / "结果.ply").stat().st_size > 100
    assert sorted(path.name for path in folder.iterdir()) == ["ö.obj", "结果.ply"]


# One writer for all outputs: whole or not at all, regular files alone, nothing left after a kill.

LIMIT = 1000  # bytes that a file may have where the disk is full


def names(folder):
    """Of files, less those by which Windows locks folders: they vanish with their process."""
    return sorted(path.name for path in folder.iterdir() if path.suffix != ".lock")


@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "socket"])
def test_only_regular_files_are_written(kind, examples, tmp_path):
    place = tmp_path / "x.safetensors"
    if kind == "pipe":
        os.mkfifo(place)
    elif kind == "folder":
        place.mkdir()
    elif kind == "socket":
        os.mknod(place, stat.S_IFSOCK | 0o600)
    else:
        place = "/dev/null"
    sdf, field = archives.load(examples["sdf"]), archives.load(examples["radial"])
    before = os.stat(place)
    for call in (sdf.save, field.save, lambda path: write_text(path, "x"), lambda path: OutputFile(path)):
        with pytest.raises((af.InvalidInput, IsADirectoryError), match=re.escape(Path(place).name)):
            call(place)
    assert os.stat(place).st_mode == before.st_mode and names(tmp_path) == names(tmp_path)[:1]


def test_links_are_followed_and_permissions_stay(tmp_path):
    (tmp_path / "real").mkdir()
    target, link, chain = tmp_path / "real" / "file", tmp_path / "link", tmp_path / "chain"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to("real/file")
    chain.symlink_to(link)
    write_text(chain, "new")
    assert chain.is_symlink() and link.is_symlink() and target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    target.unlink()
    write_text(link, "again")  # whose target is not there yet
    assert target.read_text() == "again" and link.is_symlink()
    umask = os.umask(0o027)
    write_text(tmp_path / "fresh", "x")
    os.umask(umask)
    assert stat.S_IMODE((tmp_path / "fresh").stat().st_mode) == 0o640
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(OSError):
        write_text(tmp_path / "a", "x")
    assert names(tmp_path) == ["a", "b", "chain", "fresh", "link", "real"] and names(tmp_path / "real") == [
        "file"
    ]


def test_places_that_cannot_be_named(tmp_path):
    for path in ("", "a\0b", 3, None):
        with pytest.raises(af.InvalidInput, match="path"):
            OutputFile(path)
    with pytest.raises(FileNotFoundError):
        OutputFile(tmp_path / "none" / "x")
    long = tmp_path / ("é" * 127)  # 254 bytes: the temporary name must be shorter than that and more
    write_text(long, "x")
    assert long.read_text() == "x"
    with pytest.raises(OSError):
        write_text(tmp_path / ("x" * 300), "x")
    assert names(tmp_path) == [long.name]


def test_an_error_keeps_the_existing_file(tmp_path):
    (tmp_path / "x").write_text("old")
    with pytest.raises(ZeroDivisionError), whole_file(tmp_path / "x") as partial:
        partial.write_text("new")
        raise ZeroDivisionError
    with pytest.raises(af.InvalidInput, match="nothing was written"), whole_file(tmp_path / "x"):
        pass
    with pytest.raises(af.InvalidInput, match="0 bytes"), whole_file(tmp_path / "x") as partial:
        partial.write_bytes(b"")
    with pytest.raises(OSError) as error, whole_file(tmp_path / "x") as partial:
        (partial / "no folder").write_text("x")
    assert error.value.filename == str(tmp_path / "x")
    assert (tmp_path / "x").read_text() == "old" and names(tmp_path) == ["x"]


HELD = """
import sys, time
from pathlib import Path
from arapfields._native import OutputFile
output = OutputFile(sys.argv[1])
Path(output.partial).write_text("half")
Path(output.beside).write_text("half")
print("ready", flush=True)
time.sleep(60)
"""


def test_only_files_of_killed_processes_are_removed(tmp_path):
    start = [sys.executable, "-c", HELD]
    dead = subprocess.Popen([*start, str(tmp_path / "x.ply")], stdout=subprocess.PIPE, text=True)
    alive = subprocess.Popen([*start, str(tmp_path / "x.ply")], stdout=subprocess.PIPE, text=True)
    other = subprocess.Popen([*start, str(tmp_path / "y.ply")], stdout=subprocess.PIPE, text=True)
    try:
        for running in (dead, alive, other):
            assert running.stdout.readline() == "ready\n"
        assert len(names(tmp_path)) == 6
        dead.kill()
        dead.wait()
        write_text(tmp_path / "x.ply", "whole")
        left = names(tmp_path)
        assert len(left) == 5 and sum(name.startswith(".x.ply.") for name in left) == 2
        for running in (alive, other):
            running.kill()
            running.wait()
        write_text(tmp_path / "x.ply", "whole")
        write_text(tmp_path / "y.ply", "whole")
        assert names(tmp_path) == ["x.ply", "y.ply"]
    finally:
        for running in (dead, alive, other):
            running.kill()
            running.wait()


@pytest.mark.parametrize("kind", ["sdf", "radial", "npz", "vdb", "text"])
def test_a_full_disk_is_named_and_changes_nothing(kind, examples, tmp_path):
    if kind == "vdb":
        require_bpy()  # which brings openvdb
    suffix = {"npz": ".npz", "vdb": ".vdb"}.get(kind, ".x")
    grid = np.random.default_rng(0).normal(size=(20, 20, 20)).astype(np.float32), np.zeros(3), 0.1
    if kind in examples:
        call = archives.load(examples[kind]).save
    else:

        def call(path):
            return write_text(path, "x" * 10000) if kind == "text" else save_grid(path, *grid)

    old, new = tmp_path / f"old{suffix}", tmp_path / f"new{suffix}"
    old.write_bytes(b"before")
    for place in (old, new):
        with pytest.raises(OSError) as error, files_of_at_most(LIMIT):
            call(place)
        assert error.value.filename == str(place)
    assert names(tmp_path) == [old.name] and old.read_bytes() == b"before"


@pytest.mark.parametrize("verb", ["fit", "sample", "deform", "grid", "extract", "report"])
def test_verbs_on_a_full_disk(verb, examples, tmp_path, monkeypatch, capsys):
    write_octahedron(tmp_path / "mesh.obj")
    sdf = str(examples["sdf"])
    arguments = {
        "fit": ["fit", "mesh.obj", "-o", "out.safetensors", *SMALL_FIT],
        "sample": ["sample", "mesh.obj", "-o", "out.ply", "--count", "1000"],
        "deform": ["deform", "mesh.obj", "--save-field", "out.safetensors", *HELD_AND_SHIFTED, *SMALL_SOLVE],
        "grid": ["grid", "mesh.obj", "-o", "out.npz", "--resolution", "16"],
        "extract": ["extract", sdf, "-o", "out.ply", "--resolution", "16"],
        "report": [
            "deform",
            "mesh.obj",
            "-o",
            "b.obj",
            "--report",
            "out.json",
            *HELD_AND_SHIFTED,
            *SMALL_SOLVE,
        ],
    }[verb]
    if verb == "report":
        arguments += ["--iterations", "400"]
    monkeypatch.chdir(tmp_path)
    with files_of_at_most(LIMIT):
        assert run(*arguments) in (1, 2)
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "out." in said and "Traceback" not in said, said
    assert names(tmp_path) == ["mesh.obj"]


def test_two_outputs_need_two_files(tmp_path, capsys):
    write_octahedron(tmp_path / "mesh.obj")
    (tmp_path / "link.ply").symlink_to("same.ply")
    for other in ("same.ply", "./same.ply", "link.ply"):
        arguments = ["--output", tmp_path / "same.ply", "--surface", f"{tmp_path}/{other}", *HELD_AND_SHIFTED]
        assert run("deform", tmp_path / "mesh.obj", *arguments) == 2
        assert "--surface" in capsys.readouterr().err
    assert names(tmp_path) == ["link.ply", "mesh.obj"]


def test_a_killed_verb_leaves_nothing_that_stays(tmp_path):
    write_octahedron(tmp_path / "mesh.obj")
    command, environment = process(
        "deform",
        tmp_path / "mesh.obj",
        "-o",
        tmp_path / "o.obj",
        *HELD_AND_SHIFTED,
        *SMALL_SOLVE,
        "--iterations",
        10**6,
    )
    running = subprocess.Popen(command, env=environment)
    wait_until_at_work(running)
    running.kill()
    running.wait()
    write_text(tmp_path / "o.obj", "x")
    assert names(tmp_path) == ["mesh.obj", "o.obj"]
    assert np.isfinite(os.stat(tmp_path / "o.obj").st_size)
