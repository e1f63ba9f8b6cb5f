# SPDX-License-Identifier: GPL-3.0-or-later
"""Headers and sizes of point cache files, PC2 and MDD."""

import math
import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._native import InvalidInput, require_memory

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
