# SPDX-License-Identifier: GPL-3.0-or-later
"""Atomic output files, and JSON. The package writes all files by these functions."""

import codecs
import contextlib
import json
import math
import os
import zipfile
from pathlib import Path

import numpy as np

from ._native import InvalidInput, OutputFile


@contextlib.contextmanager
def whole_file(path, beside=False):
    """Context manager: a temporary path, renamed to `path` if the block ends without an error.

    The file is in a temporary folder, or `beside` its place for content with relative paths. It is synced and
    checked before it is renamed; see OutputFile. OSErrors, also of the block, name `path`; InvalidInput if
    `path` is not a regular file.
    """
    output = OutputFile(path)
    try:
        with naming(output, path):
            yield Path(output.beside if beside else output.partial)
        output.commit()
    finally:
        output.discard()


@contextlib.contextmanager
def naming(output, path):
    """Context manager: OSErrors without a file name, or with the temporary one, name `path` instead."""
    try:
        yield
    except OSError as error:
        temporary = os.path.normpath(os.path.dirname(output.partial))
        foreign = error.filename is not None and not os.path.normpath(error.filename).startswith(temporary)
        if foreign or error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def read_text(path, errors="strict"):
    """The text of a file in UTF-8, with or without a byte order mark, or in UTF-16 with one."""
    with open(path, "rb") as file:
        is_wide = file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    return Path(path).read_text(encoding="utf-16" if is_wide else "utf-8-sig", errors=errors)


def write_text(path, text):
    """Writes a text file in UTF-8, atomically."""
    with whole_file(path) as partial:
        partial.write_text(text, encoding="utf-8", errors="surrogateescape")


def write_arrays(file, **arrays):
    """Writes a NumPy archive, as np.savez, which does not report that a file's end cannot be written."""
    with zipfile.ZipFile(file, "w", allowZip64=True) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=False)


def json_text(value, indent=None):
    """JSON of dicts, lists, numbers and arrays. NaN and infinities, which JSON lacks, become null."""
    try:
        return json.dumps(_plain(value), indent=indent, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise InvalidInput(f"report: {error}; numbers, texts, arrays, lists and dicts are allowed") from None


def _plain(value):
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def existing_file(path, suffixes=()):
    """The path of an input; InvalidInput if it is not a regular file or has another extension."""
    path = Path(path)
    if path.is_dir():
        raise InvalidInput(f"{path}: is a directory, not a file")
    if not path.exists():
        raise InvalidInput(f"{path}: no such file")
    if not path.is_file():
        raise InvalidInput(f"{path}: is not a regular file; pipes and devices cannot be read")
    if suffixes and path.suffix.lower() not in suffixes:
        raise InvalidInput(f"{path}: unknown extension; readable are {', '.join(suffixes)}")
    return path
