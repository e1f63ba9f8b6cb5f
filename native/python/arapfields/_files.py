# SPDX-License-Identifier: GPL-3.0-or-later
"""Files: read, written whole, and locked across processes."""

import codecs
import contextlib
import errno
import io
import json
import math
import os
import sys
import threading
import time
import zipfile
from pathlib import Path

import numpy as np

from ._native import InvalidInput, OutputFile, require_memory

# Atomic output files, and JSON. The package writes all files by these functions.


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


def read_text(path, errors="strict", newline=None):
    """The text of a file in UTF-8, with or without a byte order mark, or in UTF-16 with one.

    Line ends become "\n", or stay with `newline=""`.
    """
    with open(path, "rb") as file:
        is_wide = file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    encoding = "utf-16" if is_wide else "utf-8-sig"
    with open(path, encoding=encoding, errors=errors, newline=newline) as file:
        return file.read()


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


def read_arrays(file, names=None):
    """{name: array} of a NumPy archive, a path or bytes; sizes are checked before memory is asked for.

    OSError for a path that cannot be read; InvalidInput that names it for an archive that is damaged,
    foreign, or holds other names: zipfile, its decompressors and NumPy raise exceptions of many kinds then.
    """
    place = "the archive" if isinstance(file, bytes) else str(file)
    if not isinstance(file, bytes):
        require_memory(place, 2.0 * os.path.getsize(file))
        file = Path(file).read_bytes()
    arrays = {}
    try:
        with zipfile.ZipFile(io.BytesIO(file)) as archive:
            for entry in archive.infolist():
                name = entry.filename.removesuffix(".npy")
                if names is not None and name not in names:
                    raise InvalidInput(f"{place}: unknown array {name!r:.40}; known are {sorted(names)}")
                require_memory(place, 2.0 * entry.file_size)
                with archive.open(entry) as content:
                    arrays[name] = _array(content, entry.file_size)
    except InvalidInput:
        raise
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InvalidInput(f"{place}: not readable as a NumPy archive, perhaps damaged ({reason})") from error
    return arrays


def _array(file, size):
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran, kind = read(file)
    count = 1
    for length in shape:
        count *= length
    if kind.hasobject or any(length < 0 for length in shape) or file.tell() + count * kind.itemsize != size:
        raise ValueError("an array's header does not fit its content")
    array = np.frombuffer(file.read(), kind)
    return array.reshape(shape[::-1]).T if fortran else array.reshape(shape)


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


# Locks between processes on single bytes of an open file; the system releases them with the process.

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

PAUSE = 0.05  # seconds between attempts on Windows, which has no blocking call
# Windows takes positions of 32 bits; the byte need not exist. Others cannot read a locked byte there: the
# default is beyond the end of files.
LARGEST = 2**31 - 1
POSITION = threading.Lock()  # Windows locks at the file position, which threads share


def lock(file, byte=LARGEST, wait=True):
    """Locks a byte. PermissionError or BlockingIOError if another process has locked it and `wait` is False,
    OSError if the file system does not support locks."""
    if sys.platform != "win32":
        fcntl.lockf(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), 1, byte)
        return
    while True:
        try:
            set_lock(file, byte, msvcrt.LK_NBLCK)
            return
        except OSError as error:
            if error.errno not in (0, errno.EACCES):  # 0: from Wine
                raise
            if not wait:
                raise PermissionError(errno.EACCES, "another process has the lock") from error
        time.sleep(PAUSE)


def unlock(file, byte=LARGEST):
    """Unlocks a byte; errors are ignored."""
    with contextlib.suppress(OSError):
        if sys.platform != "win32":
            fcntl.lockf(file, fcntl.LOCK_UN, 1, byte)
        else:
            set_lock(file, byte, msvcrt.LK_UNLCK)


def set_lock(file, byte, mode):
    """Locks or unlocks a byte on Windows, without waiting."""
    with POSITION:
        os.lseek(file.fileno(), byte & LARGEST, os.SEEK_SET)
        msvcrt.locking(file.fileno(), mode, 1)
