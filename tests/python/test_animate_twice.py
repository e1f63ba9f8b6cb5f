# SPDX-License-Identifier: GPL-3.0-or-later
"""Two runs of `animate` on one output: the second says so, and ends well."""

import json
import subprocess

import numpy as np
import pytest
import trimesh
from support.geometry.bar import LEFT, RIGHT, turned
from support.geometry.meshes import sphere
from support.programs.cli import process, run

from arapfields._locks import lock
from arapfields._native import InvalidInput
from arapfields.cli.frames import FrameStore

FRAMES = 4
QUICK = [
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
def place(tmp_path):
    vertices, triangles = sphere(1.0, 2)
    trimesh.Trimesh(vertices * (2.0, 0.5, 0.5), triangles, process=False).export(tmp_path / "bar.ply")
    for name, step in (("tracks", 10.0), ("other", 12.0)):
        right = [(turned(step * i) @ RIGHT).tolist() for i in range(FRAMES)]
        handles = [("held", LEFT, [LEFT.tolist()] * FRAMES), ("moved", RIGHT, right)]
        told = [{"name": n, "type": "cuboid", "rest": r.tolist(), "frames": f} for n, r, f in handles]
        (tmp_path / f"{name}.json").write_text(json.dumps({"fps": 25, "start": 1, "handles": told}))
    return tmp_path


def flags(place, *further, tracks="tracks"):
    given = [place / "bar.ply", "--tracks", place / f"{tracks}.json", "-o", place / "x.pc2"]
    return "animate", *given, *QUICK, *further


def other(arguments):
    """The command in another process, whose locks are its own: exit code, and what it says."""
    command, environment = process(*arguments)
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def test_the_second_of_two_says_so(place, capfd):
    store = place / ".x.pc2.frames"
    part = "--shard", "1/2"
    assert run(*flags(place, *part)) == 0  # leaves its frames, and what it was to make
    with open(store / "lock-1-2", "r+b") as file:
        lock(file)
        code, said = other(flags(place, *part))
        assert code == 0 and "another animate is at work on the same frames" in said
        code, said = other(flags(place, *part, tracks="other"))
        assert code == 2 and "another run, of other frames" in said
    capfd.readouterr()
    assert run(*flags(place)) == 0
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


def test_a_foreign_file_among_the_frames_stays(place):
    store = place / ".x.pc2.frames"
    assert run(*flags(place, "--shard", "1/2")) == 0
    for name in ("notes.txt", "0000001-mine", "0000001-" + "x" * 32):
        (store / name).write_text("kept")
    assert run(*flags(place)) == 0
    left = {path.name for path in store.iterdir() if not path.name.startswith("lock")}
    assert left == {"notes.txt", "0000001-mine", "0000001-" + "x" * 32}
