# SPDX-License-Identifier: GPL-3.0-or-later
"""States of networks and fields as files: one .npz archive, written whole or not at all.

A state is a dict of numbers, strings, booleans, None, NumPy arrays, and lists or dicts of these. Arrays are
entries of the archive, bit for bit; the rest is JSON in the entry "header", beside the format's name and
version and the kind of thing that was saved. Nothing in a file is ever executed.
"""

import contextlib
import json
import os
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from ._native import InvalidInput

FORMAT = "arapfields"
VERSION = 1
ARRAY = "$array"  # a header's object with this one key stands for the archive's entry of that name
NAMES = {"sdf": "a neural signed distance function", "field": "a deformation field"}


def save_state(path, kind, state):
    """Writes `state` to `path`, atomically: a temporary file beside it, synced, then renamed over it.

    OSError where that fails, and then nothing new is left behind.
    """
    arrays = {}
    header = {"format": FORMAT, "version": VERSION, "kind": kind, "state": _packed(state, arrays)}
    text = np.frombuffer(json.dumps(header).encode(), np.uint8)
    path = Path(path)
    mode = _mode_of_new_files() if not path.exists() else path.stat().st_mode & 0o777
    descriptor, temporary = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            np.savez(file, header=text, **arrays)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, mode)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


def load_state(path, kind):
    """The state that save_state() wrote for the same kind.

    FileNotFoundError (or another OSError) where `path` cannot be read; InvalidInput naming the file where it
    is truncated, foreign, of another kind or of a newer version, or where an array holds NaN or infinities.
    """
    path = Path(path)
    with open(path, "rb") as file:
        try:
            with np.load(file, allow_pickle=False) as archive:
                entries = {name: archive[name] for name in archive.files}
            header = json.loads(entries.pop("header").tobytes())
            found = header["format"], header["version"], header["kind"]
        except (ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as error:
            raise _unusable(path, "it is damaged or was not written by arapfields") from error
    if found[0] != FORMAT:
        raise _unusable(path, f"its format is {found[0]!r}")
    if found[1] != VERSION:
        raise _unusable(path, f"its format version is {found[1]!r}, this release reads {VERSION}")
    if found[2] != kind:
        raise _unusable(
            path, f"it holds {NAMES.get(found[2], repr(found[2]))}, not {NAMES.get(kind, repr(kind))}"
        )
    for name, array in entries.items():
        if array.dtype.kind not in "biufSU":
            raise _unusable(path, f"array {name} has dtype {array.dtype}")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise _unusable(path, f"array {name} holds NaN or infinite numbers")
    try:
        return _unpacked(header["state"], entries)
    except (KeyError, TypeError) as error:
        raise _unusable(path, "it is damaged: an array is missing") from error


def _unusable(path, problem):
    return InvalidInput(f"{path}: cannot be loaded; {problem}")


def _packed(value, arrays, name="state"):
    """`value` as JSON allows it; arrays go to `arrays` under a name that tells where they belong."""
    if isinstance(value, np.ndarray):
        arrays[name] = np.ascontiguousarray(value).reshape(value.shape)
        return {ARRAY: name}
    if isinstance(value, dict):
        return {str(key): _packed(item, arrays, f"{name}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_packed(item, arrays, f"{name}.{i}") for i, item in enumerate(value)]
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise InvalidInput(
        f"{name}: got {type(value).__name__}; numbers, strings, arrays, lists and dicts are allowed"
    )


def _unpacked(value, arrays):
    if isinstance(value, dict):
        if set(value) == {ARRAY}:
            return arrays[value[ARRAY]]
        return {key: _unpacked(item, arrays) for key, item in value.items()}
    if isinstance(value, list):
        return [_unpacked(item, arrays) for item in value]
    return value


def _mode_of_new_files():
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
