# SPDX-License-Identifier: GPL-3.0-or-later
"""Where caches lie, and what frames weigh."""

import contextlib
import re
from pathlib import Path

import bpy

from ..core.errors import UserError
from .properties import FOLDER

SUFFIXES = {"PC2": ".pc2", "MDD": ".mdd"}
BARRED = re.compile(r'[\x00-\x1f/\\:*?"<>|]')  # letters that a file's name cannot have
HEAVY = 500e6  # bytes of shape keys, above which a cache would serve better


def cache_path(source, suffix, folder, filepath=""):
    """(absolute path, the same as the modifier has it) of an object's cache; UserError where none can be."""
    name = BARRED.sub("_", source.name)
    told = filepath or f"{folder.rstrip('/') or '/'}/{name}{suffix}"
    if told.startswith("//") and not bpy.data.filepath:
        raise UserError("save the .blend first, or choose a folder: the cache lies beside it")
    path = Path(bpy.path.abspath(told))
    if path.suffix.lower() != suffix:
        raise UserError("{path}: the format needs the extension {suffix}", path=path, suffix=suffix)
    if not filepath and folder == FOLDER:
        path.parent.mkdir(exist_ok=True)
    if not path.parent.is_dir():
        raise UserError("{folder}: no such folder", folder=path.parent)
    if bpy.data.filepath:
        with contextlib.suppress(ValueError):  # on another drive
            told = bpy.path.relpath(str(path))
    return path, told


def cache_beside(path, told, name):
    """The same as cache_path, of an object that goes along: beside the other's cache, with both names."""
    file = f"{path.stem} {BARRED.sub('_', name)}{path.suffix}"
    return path.with_name(file), told.removesuffix(path.name) + file


def plain(frame):
    """A whole frame as an integer, which is how keys are named."""
    return int(frame) if frame == int(frame) else round(frame, 4)


def keys_weight(points, frames):
    """Bytes in the .blend, and in memory, of so many shape keys and their basis."""
    return 12 * points * (frames + 1)


def size_text(count):
    """Bytes as people read them."""
    for unit, size in (("GB", 1e9), ("MB", 1e6)):
        if count >= size:
            return f"{count / size:.1f} {unit}"
    return f"{count / 1e3:.1f} kB"
