# SPDX-License-Identifier: GPL-3.0-or-later
"""Stores of solved and of wrapped frames, a file each, so that an interrupted run can be continued."""

import contextlib
import errno
import hashlib
import os
import re
import shutil
from pathlib import Path

import numpy as np

import arapfields as af

from .._files import lock, read_arrays, whole_file, write_arrays
from .._native import InvalidInput
from .._report_files import from_json, to_json
from .flags import result_options

# Store of solved frames, a file each, so that an interrupted run can be continued.

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


# Wraps onto the frames of a scanned motion, stored so that an interrupted run can be continued.


def made_of(samples, options, *further):
    """A hash object of version, options, samples and `further` bytes."""
    made = hashlib.blake2b(repr((af.__version__, result_options(options))).encode())
    for rows in (samples.points, samples.normals, samples.weights, samples.bend_weights):
        made.update(np.ascontiguousarray(rows).tobytes())
    for content in further:
        made.update(content)
    return made


class WrappedFrames:
    """Wraps onto frames in order, each from the last good one, and stores the results in a folder.

    A frame's file contains the state of the sequence after it, and its report; the file's name a hash of the
    frame, the settings and all good frames before. The field of the first frame is in a second file.
    """

    def __init__(self, folder, samples, options):
        self.folder, self.samples, self.options = folder, samples, options
        self._made = made_of(samples, options).digest()
        self._first, self._sequence, self._places = None, None, []
        self.found = 0  # number of frames read from the folder

    @property
    def good(self):
        """The number of good frames up to now."""
        return len(self._places)

    def follow(self, content, read, pairs, run):
        """(field, report) of the next frame.

        `content`: bytes of the frame; `read()` returns its ImplicitFunction; `pairs`: landmarks of the first
        frame; `run(call)` returns `call(task)`. Errors of a frame are raised; the next frame then starts from
        the last good one.
        """
        marks = repr(np.array(pairs).tolist()).encode() if self._first is None else b""
        made = hashlib.blake2b(self._made + marks + content, digest_size=16).digest()
        place = self.folder / f"{self.good:07d}-{made.hex()}"
        kept = self._kept(place)
        if kept is None:
            frame = read()
            field = run(lambda task: self._wrap(frame, pairs, task))
            kept = field, field.report
            self._keep(place, *kept)
        else:
            self.found += 1
        self._first = self._first or kept[0]
        self._made = made
        self._places.append(place)
        return kept

    def _wrap(self, frame, pairs, task):
        if self._first is None:
            return af.wrap(self.samples, frame, pairs, self.options, task=task)
        return self._behind_first().next(frame, task=task)

    def _behind_first(self):
        if self._sequence is None:
            self._sequence = af.WrapSequence(self.samples, self._first, self.options)
        return self._sequence

    def _keep(self, place, field, report):
        self.folder.mkdir(exist_ok=True)
        if self._first is None:
            field.save(field_of(place))
            state = np.empty((0, 3))
        else:
            state = self._sequence.state
        with whole_file(place) as partial:
            write_arrays(partial, state=state, report=np.array(to_json(report)))

    def _kept(self, place):
        """(field, report) from a file; None if it is missing or damaged."""
        try:
            kept = read_arrays(place)
            state, report = kept["state"], from_json(str(kept["report"]))
            if self._first is None:
                return af.DeformationField.load(field_of(place)), report
            self._behind_first().state = state
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None
        return self._sequence.field, report

    def forget_others(self):
        """Removes stored files of other frames and settings."""
        kept = {*self._places, *map(field_of, self._places[:1])}
        for path in self.folder.iterdir():
            if is_frame(path) and path not in kept:
                path.unlink(missing_ok=True)


class HeldFrames:
    """Replaces bad frames by the shape before, at the start by the first good one.

    `write(shape)` is called for each frame in order.
    """

    def __init__(self, write):
        self._write, self._last, self._waiting = write, None, 0

    def add(self, shape=None):
        """Adds the next frame's shape; None for a bad frame."""
        self._last = self._last if shape is None else shape
        self._waiting += 1
        while self._last is not None and self._waiting:
            self._write(self._last)
            self._waiting -= 1


def field_of(place):
    """The file of the first frame's field."""
    return place.with_name(f"{place.name}.safetensors")
