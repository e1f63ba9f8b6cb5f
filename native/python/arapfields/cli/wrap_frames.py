# SPDX-License-Identifier: GPL-3.0-or-later
"""Wraps of a scanned motion's frames: those that another run has made already are not made again."""

import hashlib
import zipfile

import numpy as np

import arapfields as af

from .._files import whole_file, write_arrays
from .._report_files import from_json, to_json
from .options import result_options


def made_of(samples, options, *further):
    """A hash of what wraps of one surface have in common; `further` are bytes."""
    made = hashlib.blake2b(repr((af.__version__, result_options(options))).encode())
    for rows in (samples.points, samples.normals, samples.weights, samples.bend_weights):
        made.update(np.ascontiguousarray(rows).tobytes())
    for content in further:
        made.update(content)
    return made


class WrappedFrames:
    """Wraps one frame after the other, each from the last good one, and keeps them in a folder.

    A frame's file has the sequence's state behind it, and its report. Its name tells its content, all good
    frames before it and how these were made. Beside the first frame's lies its field.
    """

    def __init__(self, folder, samples, options):
        self.folder, self.samples, self.options = folder, samples, options
        self._made = made_of(samples, options).digest()
        self._first, self._sequence, self._places = None, None, []
        self.found = 0  # frames that were there already

    @property
    def good(self):
        """How many frames there are by now, but for bad ones."""
        return len(self._places)

    def follow(self, content, read, pairs, run):
        """(field, report) of the next frame.

        `content`: bytes of the frame; `read()` gives its ImplicitFunction; `pairs` of landmarks are for the
        first one; `run(call)` gives the result of `call(task)`. What is wrong with a frame is raised, and the
        next one follows the one before.
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
        """(field, report) of a file; None where it is not there, or damaged."""
        try:
            with np.load(place, allow_pickle=False) as kept:
                state, report = kept["state"], from_json(str(kept["report"]))
            if self._first is None:
                return af.DeformationField.load(field_of(place)), report
            self._behind_first().state = state
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None
        return self._sequence.field, report

    def forget_others(self):
        """Removes what is kept of other frames and other settings."""
        kept = {*self._places, *map(field_of, self._places[:1])}
        for path in self.folder.glob("[0-9]*"):
            if path not in kept:
                path.unlink(missing_ok=True)


class HeldFrames:
    """Frames of which some are bad: these have the shape before them, or the first one.

    `write(shape)` takes each frame's in turn.
    """

    def __init__(self, write):
        self._write, self._last, self._waiting = write, None, 0

    def add(self, shape=None):
        """The next frame's shape; None for a bad one."""
        self._last = self._last if shape is None else shape
        self._waiting += 1
        while self._last is not None and self._waiting:
            self._write(self._last)
            self._waiting -= 1


def field_of(place):
    """Where the field of the first frame lies."""
    return place.with_name(f"{place.name}.safetensors")
