# SPDX-License-Identifier: GPL-3.0-or-later
"""Point caches that are damaged, and disks that are full: named, and what was there stays."""

import errno
import os
import re
import struct
import sys
from collections import namedtuple

import numpy as np
import pytest
from support.files.caches import FRAMES, POINTS, names, random_motion, write
from support.files.full_disk import files_of_at_most

import arapfields as af
from arapfields import point_cache
from arapfields.point_cache import PointCacheReader, PointCacheWriter


@pytest.fixture
def motion():
    return random_motion()


def cut(content):
    return content[:-1]


def renumbered(form, *numbers):
    return lambda content: struct.pack(form, *numbers) + content[struct.calcsize(form) :]


def spoiled(at, value):
    return lambda content: content[:at] + value + content[at + len(value) :]


BAD = {
    "pc2": [
        (lambda content: b"", "less than the header"),
        (lambda content: content[:31], "less than the header"),
        (cut, "5 samples of 7 points are 452"),
        (lambda content: content + b"x", "has 453 bytes"),
        (spoiled(0, b"POINTCACHE3"), "is no PC2"),
        (spoiled(12, struct.pack("<i", 2)), "is no PC2 of version 1"),
        (spoiled(16, struct.pack("<i", 2**31 - 1)), "2,147,483,647 points"),
        (spoiled(16, struct.pack("<i", -7)), "points: got -7"),
        (spoiled(28, struct.pack("<i", 2**31 - 1)), "samples of 7"),
        (spoiled(28, struct.pack("<i", 0)), "frames: got 0"),
        (spoiled(20, struct.pack("<f", np.nan)), "times"),
        (spoiled(24, struct.pack("<f", 0)), "times"),
    ],
    "mdd": [
        (lambda content: content[:7], "less than the header"),
        (cut, "5 samples of 7 points are 448"),
        (renumbered(">2i", 2**31 - 1, 2**31 - 1), "2,147,483,647 samples"),
        (renumbered(">2i", 0, 0), "points: got 0"),
        (renumbered("<2i", FRAMES, POINTS), "samples"),  # the wrong way round
        (spoiled(8, struct.pack(">f", np.inf)), "times"),
        (spoiled(8, struct.pack(">f", 1e9)), "do not rise"),
    ],
}


def peak():
    """Memory that this process had at most, in kB; 0 where Python cannot tell."""
    if sys.platform == "win32":
        return 0
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@pytest.mark.parametrize(
    ("suffix", "damage", "text"), [(suffix, *case) for suffix, cases in BAD.items() for case in cases]
)
def test_damaged_files_are_named(suffix, damage, text, motion, tmp_path):
    path = write(tmp_path / f"x.{suffix}", motion)
    path.write_bytes(damage(path.read_bytes()))
    before = peak()
    with pytest.raises(af.InvalidInput, match=text) as error:
        PointCacheReader(path)
    assert str(error.value).startswith(f"{path}: ")
    assert peak() - before < 50_000  # kB: nothing of that size


def test_frames_that_are_not_finite_or_gone_are_named(motion, tmp_path):
    path = write(tmp_path / "x.pc2", motion)
    content = bytearray(path.read_bytes())
    at = 32 + 12 * POINTS * 2 + 12 * 3
    content[at : at + 4] = struct.pack("<f", np.nan)
    path.write_bytes(content)
    with PointCacheReader(path) as cache:
        assert np.array_equal(cache[1], motion[1])
        with pytest.raises(af.InvalidInput, match=r"x\.pc2: sample 2: point 3"):
            cache[2]
        os.truncate(path, 200)
        with pytest.raises(af.InvalidInput, match=r"x\.pc2: sample 4: became shorter"):
            cache[4]


def test_what_is_no_file_of_ours_is_named(tmp_path):
    for path in (tmp_path, tmp_path / "none.pc2", tmp_path / "x.abc"):
        with pytest.raises(af.InvalidInput, match=re.escape(str(path))):
            PointCacheReader(path)
    with pytest.raises(FileNotFoundError):
        PointCacheWriter(tmp_path / "none" / "x.pc2", 1, 1)


def test_a_disk_too_small_shows_before_the_first_frame(motion, tmp_path, monkeypatch):
    before = write(tmp_path / "x.pc2", motion).read_bytes()
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(point_cache.shutil, "disk_usage", lambda place: usage(451))
    with pytest.raises(OSError, match="takes 452 bytes, 451 are free") as error:
        PointCacheWriter(tmp_path / "x.pc2", POINTS, FRAMES)
    assert error.value.errno == errno.ENOSPC and error.value.filename == str(tmp_path / "x.pc2")
    assert (tmp_path / "x.pc2").read_bytes() == before and names(tmp_path) == ["x.pc2"]


def test_a_disk_that_fills_meanwhile_is_named(motion, tmp_path):
    """A limit on a file's size stands for the full disk: the system refuses in the middle of a frame."""
    path = write(tmp_path / "x.pc2", motion)
    before = path.read_bytes()
    with (
        pytest.raises(OSError) as error,
        files_of_at_most(300_000),
        PointCacheWriter(path, 1000, 100) as cache,
    ):
        for _ in range(100):
            cache.write(np.ones((1000, 3)))
    assert (error.value.errno, error.value.filename) == (errno.EFBIG, str(path))
    assert path.read_bytes() == before and names(tmp_path) == ["x.pc2"]
