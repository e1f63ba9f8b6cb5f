# SPDX-License-Identifier: GPL-3.0-or-later
"""Outputs that appear whole or not at all, and reports as JSON. Every file of ours is written by these."""

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
    """The path of a file to write, which becomes `path` when the block ends without an error.

    It lies in a temporary folder, or `beside` its place for content with paths relative to it. At the end it
    is brought to the disk, looked at, and renamed; see OutputFile. OSError, also of what the block raises,
    names `path`; InvalidInput where `path` holds something else than a regular file.
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
    """An OSError of the block that names no file, or the output's temporary one, names `path` instead."""
    try:
        yield
    except OSError as error:
        temporary = os.path.normpath(os.path.dirname(output.partial))
        foreign = error.filename is not None and not os.path.normpath(error.filename).startswith(temporary)
        if foreign or error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def read_text(path, errors="strict"):
    """The text of a file in UTF-8, also with the byte order mark that Windows' programs put first, or in
    UTF-16 with one."""
    with open(path, "rb") as file:
        is_wide = file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    return Path(path).read_text(encoding="utf-16" if is_wide else "utf-8-sig", errors=errors)


def write_text(path, text):
    """Writes UTF-8, whole or not at all."""
    with whole_file(path) as partial:
        partial.write_text(text, encoding="utf-8", errors="surrogateescape")


def write_arrays(file, **arrays):
    """Writes a NumPy archive, as np.savez does, which tells nobody where its end cannot be written."""
    with zipfile.ZipFile(file, "w", allowZip64=True) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=False)


def json_text(value, indent=None):
    """JSON of dicts, lists, numbers and arrays. NaN and infinities, which JSON has not, become null."""
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
    """The path of an input; InvalidInput for what is no regular file or has another extension."""
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
