# SPDX-License-Identifier: GPL-3.0-or-later
"""One writer for all outputs: whole or not at all, regular files alone, nothing left after a kill."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import require_bpy
from support.files import archives
from support.files.full_disk import files_of_at_most
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
from arapfields._files import whole_file, write_text
from arapfields._native import OutputFile
from arapfields.grids import save_grid

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
