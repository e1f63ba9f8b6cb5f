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
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ._files import existing_file, naming
from ._native import InvalidInput, OutputFile, real_array, require_memory
from ._point_cache_layout import SUFFIXES, Layout, layout_of, times_of
from .arrays import ArrayLike

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
