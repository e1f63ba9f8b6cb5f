# SPDX-License-Identifier: GPL-3.0-or-later
"""Wraps onto the frames of a scanned motion, stored so that an interrupted run can be continued."""

import hashlib

import numpy as np

import arapfields as af

from .._files import read_arrays, whole_file, write_arrays
from .._report_files import from_json, to_json
from .frames import is_frame
from .options import result_options


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
