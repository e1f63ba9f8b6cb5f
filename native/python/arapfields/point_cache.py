# SPDX-License-Identifier: GPL-3.0-or-later
"""Point caches: a mesh's vertices in each frame, in the two formats of Blender's Mesh Cache modifier.

    with PointCacheWriter("walk.pc2", points=len(vertices), frames=250, start=1) as cache:
        for positions in motion:
            cache.write(positions)

**PC2**, little-endian: "POINTCACHE2\\0", version 1 and the number of points (int32), start and sampling rate,
both in frames (float32), the number of samples (int32); then for each sample three float32 per point.
**MDD**, big-endian: the numbers of samples and of points (int32), each sample's time in seconds (float32),
then three float32 per point as before. Only one frame is held in memory.
"""

import errno
import math
import os
import shutil
import struct
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ._files import existing_file, naming
from ._native import InvalidInput, OutputFile, real_array, require_memory
from .arrays import ArrayLike

# Headers and sizes of point cache files, PC2 and MDD.

SUFFIXES = (".pc2", ".mdd")
PC2_HEADER = struct.Struct("<12s2i2fi")
PC2_MAGIC, PC2_VERSION = b"POINTCACHE2\0", 1
MDD_HEADER = struct.Struct(">2i")
MOST = 2**31 - 1  # largest int32


@dataclass(frozen=True)
class Layout:
    """Layout of a file with `frames` samples of `points` points."""

    suffix: str
    points: int
    frames: int

    def __post_init__(self) -> None:
        if self.suffix not in SUFFIXES:
            known = ", ".join(SUFFIXES)
            raise InvalidInput(f"{self.suffix or 'no extension'}: unknown; point caches are {known}")
        for name, number in (("points", self.points), ("frames", self.frames)):
            whole = isinstance(number, int | np.integer) and not isinstance(number, bool)
            if not whole or not 1 <= number <= MOST:
                raise InvalidInput(f"{name}: got {number!r:.40}; an integer from 1 to {MOST} is needed")

    @property
    def pc2(self) -> bool:
        return self.suffix == ".pc2"

    @property
    def type(self) -> np.dtype[np.float32]:
        """Data type of the coordinates."""
        return np.dtype("<f4" if self.pc2 else ">f4")

    @property
    def sample_bytes(self) -> int:
        return 12 * int(self.points)

    @property
    def begin(self) -> int:
        """Position of the first sample, in bytes."""
        return PC2_HEADER.size if self.pc2 else MDD_HEADER.size + 4 * int(self.frames)

    @property
    def size(self) -> int:
        """Size of the file, in bytes."""
        return self.begin + self.sample_bytes * int(self.frames)

    def header(self, start: float, step: float, fps: float) -> bytes:
        """All bytes before the first sample."""
        start, step = number("start", start), number("step", step, positive=True)
        if self.pc2:
            return PC2_HEADER.pack(PC2_MAGIC, PC2_VERSION, self.points, start, step, self.frames)
        fps = number("fps", fps, positive=True)
        require_memory("frames", 16.0 * self.frames)
        times = ((start + step * np.arange(self.frames)) / fps).astype(np.float32)
        if not (np.diff(times) > 0).all():
            raise InvalidInput(f"step: {step:g} frames vanish beside frame {start:g} in an MDD's times")
        return MDD_HEADER.pack(self.frames, self.points) + times.astype(">f4").tobytes()


def layout_of(suffix: str, beginning: bytes, size: int) -> Layout:
    """The layout of a file by its first bytes and its size; InvalidInput if they contradict each other."""
    pc2 = suffix == ".pc2"
    kind = PC2_HEADER if pc2 else MDD_HEADER
    if len(beginning) < kind.size:
        raise InvalidInput(f"has {size} bytes, less than the header of a {suffix[1:].upper()}")
    header = kind.unpack_from(beginning)
    if pc2 and header[:2] != (PC2_MAGIC, PC2_VERSION):
        raise InvalidInput(f"is no PC2 of version {PC2_VERSION}, whatever its name says")
    points, frames = (header[2], header[5]) if pc2 else (header[1], header[0])
    try:
        layout = Layout(suffix, points, frames)
    except InvalidInput as error:
        raise InvalidInput(f"damaged; {error}") from None
    if size != layout.size:
        raise InvalidInput(f"has {size:,} bytes; {frames:,} samples of {points:,} points are {layout.size:,}")
    return layout


def times_of(layout: Layout, beginning: bytes) -> npt.NDArray[np.float64]:
    """Frame (PC2) or seconds (MDD) of each sample; `beginning`: all bytes before the first sample."""
    if layout.pc2:
        start, step = PC2_HEADER.unpack(beginning)[3:5]
        times = float(start) + float(step) * np.arange(layout.frames)
    else:
        times = np.frombuffer(beginning[MDD_HEADER.size :], ">f4").astype(float)
    if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise InvalidInput("damaged; its times do not rise")
    return times


def number(name: str, value: float, positive: bool = False) -> float:
    """The number rounded to single precision; InvalidInput if it is not finite there."""
    try:
        kept = float(np.float32(value)) if abs(value) < 3e38 else math.nan
    except (TypeError, ValueError):
        kept = math.nan
    if not math.isfinite(kept) or (positive and kept <= 0):
        raise InvalidInput(
            f"{name}: got {value!r:.40}; a finite number{' above 0' if positive else ''} is needed"
        )
    return kept


# Point caches: a mesh's vertices in each frame, in the two formats of Blender's Mesh Cache modifier.
#
# with PointCacheWriter("walk.pc2", points=len(vertices), frames=250, start=1) as cache: for positions in
# motion: cache.write(positions)
#
# **PC2**, little-endian: "POINTCACHE2\0", version 1 and the number of points (int32), start and sampling
# rate, both in frames (float32), the number of samples (int32); then for each sample three float32 per
# point. **MDD**, big-endian: the numbers of samples and of points (int32), each sample's time in seconds
# (float32), then three float32 per point as before. Only one frame is held in memory.

FilePath: TypeAlias = str | os.PathLike[str]
Frame: TypeAlias = npt.NDArray[np.float32]


class PointCacheWriter:
    """Writes a cache frame by frame; the file is replaced atomically at the end.

    Sample i is at frame start + i · step, which may be fractional; an MDD stores seconds, by `fps`. As a
    context manager it commits if the block ends without an error, else it leaves an existing file. Otherwise
    call finish(), which syncs and checks the file, then commit(), which renames it, and in any case
    discard(); finish several caches before the first commit to replace all or none. InvalidInput for invalid
    arguments; OSError with the file's name if the disk is full (if possible before the first frame) or the
    system fails.
    """

    def __init__(
        self,
        path: FilePath,
        points: int,
        frames: int,
        *,
        start: float = 0.0,
        step: float = 1.0,
        fps: float = 24.0,
    ) -> None:
        self.path, self.written, self._finished = Path(path), 0, False
        try:
            self._layout = Layout(self.path.suffix.lower(), points, frames)
            header = self._layout.header(start, step, fps)
        except InvalidInput as error:
            raise InvalidInput(f"{path}: {error}") from None
        self._output = OutputFile(path)
        try:
            self._require_room(shutil.disk_usage(Path(self._output.partial).parent).free)
            with naming(self._output, path):
                self._file = open(self._output.partial, "xb")  # noqa: SIM115
                self._file.write(header)
        except BaseException:
            self.discard()
            raise

    @property
    def points(self) -> int:
        """The number of points in each sample."""
        return int(self._layout.points)

    @property
    def frames(self) -> int:
        """The number of samples of the complete cache; `written` of them are written."""
        return int(self._layout.frames)

    def _require_room(self, free: int) -> None:
        if free < self._layout.size:
            full = os.strerror(errno.ENOSPC)
            needs = f"{full}: the cache takes {self._layout.size:,} bytes, {free:,} are free"
            raise OSError(errno.ENOSPC, needs, str(self.path))

    def write(self, positions: ArrayLike) -> None:
        """Writes the next frame's positions (points, 3); InvalidInput names an invalid frame."""
        where = f"{self.path}: sample {self.written}"
        if self.written >= self.frames:
            raise InvalidInput(f"{where}: the cache was made for {self.frames}")
        kept = isinstance(positions, np.ndarray) and positions.dtype in (np.float32, np.float64)
        array = np.asarray(positions if kept else real_array(positions, "positions"))
        if array.shape != (self.points, 3):
            raise InvalidInput(f"{where}: has shape {array.shape}; ({self.points}, 3) is needed")
        with np.errstate(over="ignore"):
            sample = np.ascontiguousarray(array, self._layout.type)
        _require_finite(sample, where)
        with naming(self._output, self.path):
            self._file.write(sample.data)
        self.written += 1

    def finish(self) -> None:
        """Syncs the file and checks its size."""
        if self.written < self.frames:
            raise InvalidInput(f"{self.path}: {self.written} of {self.frames} samples were written")
        with naming(self._output, self.path):
            self._file.close()
        self._output.finish()
        arrived = os.path.getsize(self._output.partial)
        if arrived != self._layout.size:
            raise OSError(errno.EIO, f"{arrived:,} of {self._layout.size:,} bytes arrived", str(self.path))
        self._finished = True

    def commit(self) -> None:
        """Calls finish() if necessary, and renames the file to its place."""
        if not self._finished:
            self.finish()
        self._output.commit()

    def discard(self) -> None:
        """Removes the temporary file if it is not committed."""
        try:
            if hasattr(self, "_file"):
                self._file.close()
        except OSError:
            pass  # a full disk, which was reported before
        finally:
            self._output.discard()

    def __enter__(self) -> "PointCacheWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self.commit()
        finally:
            self.discard()


class PointCacheReader:
    """Reads the frames of a cache in any order: cache[i] is an array (points, 3), len(cache) their number.

    `times` (frames,) are frames in a PC2, seconds in an MDD, as `unit` says. The header is checked against
    the file's size first: InvalidInput names a file that is truncated, no point cache, or has values that
    are not finite.
    """

    def __init__(self, path: FilePath) -> None:
        self.path = existing_file(path, SUFFIXES)
        self._file = open(self.path, "rb", buffering=0)  # noqa: SIM115
        self._one_at_a_time = threading.Lock()
        try:
            self._layout, self.times = self._header()
        except InvalidInput as error:
            self.close()
            raise InvalidInput(f"{self.path}: {error}") from None
        except BaseException:
            self.close()
            raise
        self.unit = "frames" if self._layout.pc2 else "seconds"

    def _header(self) -> tuple[Layout, npt.NDArray[np.float64]]:
        size = os.fstat(self._file.fileno()).st_size
        layout = layout_of(self.path.suffix.lower(), self._exactly(min(size, 32)), size)
        require_memory("samples", 16.0 * layout.frames + layout.sample_bytes)
        self._file.seek(0)
        return layout, times_of(layout, self._exactly(layout.begin))

    @property
    def points(self) -> int:
        """The number of points in each sample."""
        return int(self._layout.points)

    def _exactly(self, count: int) -> bytes:
        parts = []
        while count:
            part = self._file.read(count)
            if not part:
                raise InvalidInput("became shorter while it was read")
            parts.append(part)
            count -= len(part)
        return b"".join(parts)

    def __len__(self) -> int:
        return int(self._layout.frames)

    def __getitem__(self, index: int) -> Frame:
        if not -len(self) <= index < len(self):
            raise IndexError(f"sample {index} of {len(self)}")
        index %= len(self)
        where = f"{self.path}: sample {index}"
        try:
            with self._one_at_a_time:
                self._file.seek(self._layout.begin + self._layout.sample_bytes * index)
                content = self._exactly(self._layout.sample_bytes)
        except InvalidInput as error:
            raise InvalidInput(f"{where}: {error}") from None
        sample = np.frombuffer(content, self._layout.type).reshape(self.points, 3)
        _require_finite(sample, where)
        return sample.astype(np.float32)

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))

    def close(self) -> None:
        """Closes the file."""
        self._file.close()

    def __enter__(self) -> "PointCacheReader":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _require_finite(sample: npt.NDArray[Any], where: str) -> None:
    if not np.isfinite(sample).all():
        first = int(np.flatnonzero(~np.isfinite(sample).all(axis=1))[0])
        raise InvalidInput(f"{where}: point {first} is NaN, infinite or beyond single precision")
