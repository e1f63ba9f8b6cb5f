# SPDX-License-Identifier: GPL-3.0-or-later
"""Store of solved frames, a file each, so that an interrupted run can be continued."""

import contextlib
import errno
import hashlib
import os
import re
import shutil
from pathlib import Path

import numpy as np

from .._files import whole_file
from .._locks import lock
from .._native import InvalidInput

TYPE = np.dtype("<f4")
FRAME = re.compile(
    r"\d{7,}-[0-9a-f]{24,32}(\.safetensors)?"
)  # names of solved frames, of a wrapped one's field
LOCK = re.compile(r"lock(-.*)?")


def folder_beside(output):
    """The folder ".NAME.frames" for solved frames of an output."""
    return output.with_name(f".{output.name}.frames")


def is_frame(path):
    return FRAME.fullmatch(path.name) is not None


class FrameStore:
    """The folder of solved frames beside an output. Several processes and machines may write to it.

    Files are replaced atomically, and their names contain a hash of the inputs: after a change of handles,
    mesh, options or version a frame is not found.
    """

    def __init__(self, output, points, common):
        """`common`: bytes of all inputs that the frames have in common."""
        self.output = output = Path(output)
        self.folder = folder_beside(output)
        self.points, self._common = points, hashlib.blake2b(common, digest_size=16).digest()

    @property
    def frame_bytes(self):
        return TYPE.itemsize * 3 * self.points

    def place(self, number, targets):
        content = hashlib.blake2b(self._common, digest_size=12)
        for target in targets:
            content.update(np.ascontiguousarray(target, "<f8").tobytes())
        return self.folder / f"{number:07d}-{content.hexdigest()}"

    def has(self, place):
        try:
            return place.stat().st_size == self.frame_bytes
        except OSError:
            return False

    def put(self, place, positions):
        """Stores positions (points, 3); InvalidInput if they are not finite."""
        with np.errstate(over="ignore"):
            kept = np.ascontiguousarray(positions, TYPE)
        if not np.isfinite(kept).all():
            raise InvalidInput(f"frame {int(place.name[:7])}: the solve gave no finite positions")
        self.folder.mkdir(exist_ok=True)
        with whole_file(place) as partial:
            kept.tofile(partial)

    def get(self, place):
        try:
            frame = np.fromfile(place, TYPE)
        except FileNotFoundError:
            frame = np.empty(0)
        if frame.size != 3 * self.points:
            raise OSError(errno.EIO, "a solved frame has gone meanwhile; run it again", str(place))
        return frame.reshape(-1, 3)

    def require_room(self, missing, output_bytes):
        """OSError if the missing frames and the output do not fit on the disk."""
        needed = missing * self.frame_bytes + output_bytes
        free = shutil.disk_usage(self.folder.parent).free
        if free < needed:
            text = f"{os.strerror(errno.ENOSPC)}: {needed:,} bytes are needed for a while, {free:,} are free"
            raise OSError(errno.ENOSPC, text, str(self.folder.parent))

    @contextlib.contextmanager
    def only_run(self, part, places):
        """Context manager: False if another process solves the same part of the frames.

        InvalidInput if that process solves other frames or options. True without locks of the file system.
        """
        first = False
        try:
            with self._one_run(part, places) as first:
                yield first
        finally:
            if first and os.name == "nt" and self.folder.exists():  # Windows cannot remove an open file
                self.remove(())

    @contextlib.contextmanager
    def _one_run(self, part, places):
        self.folder.mkdir(exist_ok=True)
        made = "\n".join(place.name for place in places).encode()
        with open(self.folder / f"lock-{part}", "a+b") as file:
            try:
                lock(file, wait=False)
            except (PermissionError, BlockingIOError):
                file.seek(0)
                if file.read() != made:
                    raise InvalidInput(
                        f"{self.output}: another run, of other frames or options, is at work on it; "
                        "let it end, or choose another output"
                    ) from None
                yield False
                return
            except OSError:
                pass
            file.truncate(0)
            file.write(made)
            file.flush()
            try:
                yield True
            finally:
                if self.folder.exists():
                    self.remove(())

    @contextlib.contextmanager
    def alone(self):
        """Context manager that one process at a time enters, if the file system supports locks."""
        self.folder.mkdir(exist_ok=True)
        with open(self.folder / "lock", "ab") as file:
            with contextlib.suppress(OSError):
                lock(file)
            yield

    def remove(self, places=None):
        """Removes these frames; with None all, also those of other settings. Foreign files stay."""
        for place in places if places is not None else filter(is_frame, self.folder.iterdir()):
            place.unlink(missing_ok=True)
        if all(LOCK.fullmatch(path.name) for path in self.folder.iterdir()):
            shutil.rmtree(self.folder, ignore_errors=True)
