# SPDX-License-Identifier: GPL-3.0-or-later
"""Point caches, PC2 and MDD: their bytes, damage, and disks that are full."""

import errno
import os
import re
import shutil
import struct
import subprocess
import sys
from collections import namedtuple

import numpy as np
import pytest
from support.files.archives import FRAMES, POINTS, files_of_at_most, names, random_motion, write_cache

import arapfields as af
from arapfields import point_cache
from arapfields.point_cache import PointCacheReader, PointCacheWriter

# PC2 and MDD: the bytes that the formats say, whole or not at all.

HEADERS = {"pc2": 32, "mdd": 8 + 4 * FRAMES}


@pytest.fixture
def motion():
    return random_motion()


@pytest.mark.parametrize("suffix", ["pc2", "mdd", "PC2"])
def test_written_caches_are_read(suffix, motion, tmp_path):
    path = write_cache(tmp_path / f"x.{suffix}", motion, start=10, step=0.5, fps=25)
    assert path.stat().st_size == HEADERS[suffix.lower()] + 12 * POINTS * FRAMES
    with PointCacheReader(path) as cache:
        assert (len(cache), cache.points) == (FRAMES, POINTS)
        assert all(np.array_equal(a, b) for a, b in zip(cache, motion, strict=True))
        assert np.array_equal(cache[-1], motion[-1]) and np.array_equal(cache[2], motion[2])
        assert cache[0].dtype == np.float32 and cache[0].dtype.isnative
        frames = 10 + 0.5 * np.arange(FRAMES)
        assert cache.unit == ("seconds" if suffix == "mdd" else "frames")
        # Single precision keeps 24 bits.
        np.testing.assert_allclose(cache.times, frames / 25 if suffix == "mdd" else frames, rtol=2**-23)
        for outside in (FRAMES, -FRAMES - 1):
            with pytest.raises(IndexError):
                cache[outside]


def test_bytes_follow_the_formats(motion, tmp_path):
    pc2 = write_cache(tmp_path / "x.pc2", motion, start=3, step=2).read_bytes()
    assert pc2[:12] == b"POINTCACHE2\0"
    assert struct.unpack("<2i2fi", pc2[12:32]) == (1, POINTS, 3.0, 2.0, FRAMES)
    assert pc2[32:] == motion.astype("<f4").tobytes()
    mdd = write_cache(tmp_path / "x.mdd", motion, start=3, step=2, fps=4).read_bytes()
    assert struct.unpack(">2i", mdd[:8]) == (FRAMES, POINTS)
    assert np.array_equal(np.frombuffer(mdd[8:28], ">f4"), [0.75, 1.25, 1.75, 2.25, 2.75])
    assert mdd[28:] == motion.astype(">f4").tobytes()


def test_other_arrays_are_taken(motion, tmp_path):
    with PointCacheWriter(tmp_path / "x.pc2", POINTS, 4) as cache:
        cache.write(motion[0].astype(float))
        cache.write(motion[0].tolist())
        cache.write(np.asfortranarray(motion[0]))
        cache.write(motion[0].astype(">f4"))
    with PointCacheReader(tmp_path / "x.pc2") as cache:
        assert all(np.array_equal(positions, motion[0]) for positions in cache)


@pytest.mark.parametrize(
    ("positions", "text"),
    [
        (np.full((POINTS, 3), np.nan), "point 0 is NaN"),
        (np.where(np.arange(POINTS)[:, None] == 4, np.inf, np.ones(3)), "point 4 is NaN, infinite"),
        (np.full((POINTS, 3), 1e39), "beyond single precision"),
        (np.zeros((POINTS + 1, 3)), r"shape \(8, 3\)"),
        (np.zeros(3 * POINTS), "shape"),
        (np.full((POINTS, 3), "a"), "positions"),
        (None, "positions"),
    ],
)
def test_frames_that_cannot_be_kept(positions, text, motion, tmp_path):
    before = write_cache(tmp_path / "x.pc2", motion).read_bytes()
    with (
        pytest.raises(af.InvalidInput, match=text),
        PointCacheWriter(tmp_path / "x.pc2", POINTS, FRAMES) as cache,
    ):
        cache.write(positions)
    assert (tmp_path / "x.pc2").read_bytes() == before and names(tmp_path) == ["x.pc2"]


@pytest.mark.parametrize("written", [0, 2, FRAMES + 1])
def test_a_cache_has_the_frames_that_were_promised(written, motion, tmp_path):
    before = write_cache(tmp_path / "x.mdd", motion).read_bytes()
    with (
        pytest.raises(af.InvalidInput, match=r"x\.mdd: (sample 5: the cache was made|. of 5 samples)"),
        PointCacheWriter(tmp_path / "x.mdd", POINTS, FRAMES) as cache,
    ):
        for _ in range(written):
            cache.write(motion[0] + 1)
    assert (tmp_path / "x.mdd").read_bytes() == before and names(tmp_path) == ["x.mdd"]


def test_an_error_in_the_block_keeps_the_existing_cache(motion, tmp_path):
    with (
        pytest.raises(ZeroDivisionError),
        PointCacheWriter(tmp_path / "x.pc2", POINTS, FRAMES) as cache,
    ):
        cache.write(motion[0])
        raise ZeroDivisionError
    assert names(tmp_path) == []


def test_several_caches_take_their_places_together(motion, tmp_path):
    caches = [PointCacheWriter(tmp_path / f"{i}.pc2", POINTS, FRAMES) for i in range(3)]
    for positions in motion:
        for cache in caches:
            cache.write(positions)
    for cache in caches:
        cache.finish()
    assert not list(tmp_path.glob("*.pc2"))
    for cache in caches:
        cache.commit()
        cache.discard()
    assert names(tmp_path) == ["0.pc2", "1.pc2", "2.pc2"]


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"points": 0}, "points"),
        ({"points": -3}, "points"),
        ({"points": 2**31}, "points"),
        ({"points": 2.0}, "points"),
        ({"frames": 0}, "frames: got 0"),
        ({"frames": True}, "frames"),
        ({"start": np.nan}, "start"),
        ({"start": "a"}, "start"),
        ({"step": 0}, "step"),
        ({"step": -1}, "step"),
        ({"step": 1e-50}, "step"),
        ({"step": np.inf}, "step"),
        ({"fps": 0}, "fps"),
        ({"start": 1e9, "step": 0.5}, "vanish"),
        ({"path": "x.abc"}, "unknown; point caches are .pc2, .mdd"),
        ({"path": "x"}, "no extension"),
    ],
)
def test_bad_cache_settings_are_named(settings, text, tmp_path):
    settings = {"path": "x.mdd", "points": POINTS, "frames": FRAMES} | settings
    path = tmp_path / settings.pop("path")
    with pytest.raises(af.InvalidInput, match=text) as error:
        PointCacheWriter(path, **settings)
    assert str(path) in str(error.value) and names(tmp_path) == []


MANY = """
import resource, sys
import numpy as np
from arapfields.point_cache import PointCacheReader, PointCacheWriter
frame = np.random.default_rng(0).normal(size=(20_000, 3))
def peak(count):
    with PointCacheWriter(sys.argv[1], len(frame), count) as cache:
        for _ in range(count):
            cache.write(frame)
    with PointCacheReader(sys.argv[1]) as cache:
        for _ in cache:
            pass
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
few = peak(4)
print(peak(400) - few)
"""


def test_memory_does_not_grow_with_the_frames(tmp_path):
    """396 further frames are 95 MB; what the interpreter keeps stays far below."""
    said = subprocess.run(
        [sys.executable, "-c", MANY, tmp_path / "x.pc2"], capture_output=True, text=True, check=True
    )
    assert int(said.stdout) < 5000  # kB


def test_a_folder_that_goes_while_it_is_written_to_is_named(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    writer = PointCacheWriter(folder / "a.pc2", points=10, frames=4)
    for frame in range(4):
        if frame == 2:
            shutil.rmtree(folder)
        writer.write(np.zeros((10, 3)))
    with pytest.raises(af.InvalidInput, match="its folder is gone"):
        writer.finish()


# Point caches that are damaged, and disks that are full: named, and what was there stays.


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
    path = write_cache(tmp_path / f"x.{suffix}", motion)
    path.write_bytes(damage(path.read_bytes()))
    before = peak()
    with pytest.raises(af.InvalidInput, match=text) as error:
        PointCacheReader(path)
    assert str(error.value).startswith(f"{path}: ")
    assert peak() - before < 50_000  # kB: nothing of that size


def test_infinite_and_missing_frames_are_named(motion, tmp_path):
    path = write_cache(tmp_path / "x.pc2", motion)
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


def test_foreign_files_are_named(tmp_path):
    for path in (tmp_path, tmp_path / "none.pc2", tmp_path / "x.abc"):
        with pytest.raises(af.InvalidInput, match=re.escape(str(path))):
            PointCacheReader(path)
    with pytest.raises(FileNotFoundError):
        PointCacheWriter(tmp_path / "none" / "x.pc2", 1, 1)


def test_a_disk_too_small_shows_before_the_first_frame(motion, tmp_path, monkeypatch):
    before = write_cache(tmp_path / "x.pc2", motion).read_bytes()
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(point_cache.shutil, "disk_usage", lambda place: usage(451))
    with pytest.raises(OSError, match="takes 452 bytes, 451 are free") as error:
        PointCacheWriter(tmp_path / "x.pc2", POINTS, FRAMES)
    assert error.value.errno == errno.ENOSPC and error.value.filename == str(tmp_path / "x.pc2")
    assert (tmp_path / "x.pc2").read_bytes() == before and names(tmp_path) == ["x.pc2"]


def test_a_disk_that_fills_meanwhile_is_named(motion, tmp_path):
    """A limit on a file's size stands for the full disk: the system refuses in the middle of a frame."""
    path = write_cache(tmp_path / "x.pc2", motion)
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
