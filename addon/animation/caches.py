# SPDX-License-Identifier: GPL-3.0-or-later
"""Stores for the frames of a bake, cache files or shape keys, and whether they still fit the object."""

import contextlib
import hashlib
import json
import os
import re
import sys
from pathlib import Path

import bpy

from ..blender import mesh_arrays, modifier_stack
from ..blender.language import translated
from ..blender.object_references import results_of, settings_of
from ..blender.point_data import points_of
from ..carried import points
from ..core.errors import UserError, as_user_error, refuse
from ..core.runtime import native
from ..core.runtime.jobs import Pause
from ..field_modifier import cache_modifier, node_group
from ..results import placement

# Stores for the frames of a bake, cache files or shape keys, and their sizes.

SUFFIXES = {"PC2": ".pc2", "MDD": ".mdd"}
SEPARATOR = "~"  # between the parts of a name
BARRED = re.compile(r'[\x00-\x1f/\\:*?"<>|%~]')  # characters that parts of file names cannot have
LONGEST = 200  # bytes of a name without extension; file systems take 255
HEAVY = 500e6  # bytes of shape keys above which a cache is recommended


class ShapeKeys:
    """The frames of one object, kept in memory for its shape keys."""

    def __init__(self):
        self.shapes, self.item = [], None  # item: an object in no scene, with the keys

    def open(self, solver):
        """Called before the first frame; on the worker, as all methods but `commit`."""

    def add(self, points):
        self.shapes.append(points)

    def finish(self):
        """Called after the last frame."""

    def discard(self):
        self.shapes.clear()

    def make(self, mesh, frames, job):
        """Coroutine on the main thread: an object of that mesh with a shape key a frame."""
        self.item, names = bpy.data.objects.new(mesh.name, mesh), [plain(frame) for frame in frames]
        for number, frame in enumerate(names):
            text = translated("Storing frame {frame}", frame=frame)
            job.report_main_thread(number / len(names), text)
            placement.add_frame(self.item, names, number, self.shapes[number])
            self.shapes[number] = None  # stored in the key
            yield Pause.REDRAW

    def forget(self):
        """Removes the temporary object; another one has its mesh."""
        bpy.data.objects.remove(self.item)
        self.item = None

    def discard_item(self):
        """Removes the temporary object with its mesh; on the main thread."""
        if self.item is not None:
            with contextlib.suppress(ReferenceError):  # another file was loaded
                placement.discard(self.item)


class OutputFolder:
    """A folder that may be new: made when it is needed, and removed if nothing is written to it."""

    def __init__(self, path):
        self.path, self._is_new = path, not path.exists()

    def make(self):
        self.path.mkdir(exist_ok=True)

    def remove_if_unused(self):
        """Removes the folder if it is new and empty."""
        if self._is_new:
            with contextlib.suppress(OSError):  # it is not empty, or was never made
                self.path.rmdir()


class CacheFile:
    """The frames of one object in a point cache file, which `commit` moves to its final path."""

    def __init__(self, path, frames, fps):
        self.path, self.frames, self._fps = path, frames, fps
        self._writer, self._folder = None, OutputFolder(path.parent)

    def discard_item(self):
        """Does nothing: there is no temporary object."""

    def open(self, solver):
        self.open_for(len(solver.rest))

    def open_for(self, points):
        """Opens the writer for that number of points."""
        from arapfields.point_cache import PointCacheWriter

        frames, times = self.frames, {"start": self.frames.start, "step": self.frames.step, "fps": self._fps}
        self._folder.make()
        self._writer = PointCacheWriter(self.path, points, frames.count, **times)

    def add(self, points):
        self._writer.write(points)

    def finish(self):
        self._writer.finish()

    def commit(self):
        """Moves the cache to its final path; on the main thread."""
        try:
            self._writer.commit()
        except OSError as error:
            raise as_user_error(error) from error

    def discard(self):
        """Removes an uncommitted cache and its new folder; a cache of an earlier bake stays."""
        if self._writer is not None:
            self._writer.discard()
        self._folder.remove_if_unused()

    def play_on(self, item):
        """Adds the modifier that plays the cache to an object."""
        cache_modifier.play(item, shown_path(self.path), self.frames.start, self.frames.step)


def encoded(name):
    """A name as a part of a file's: what file names cannot have, and the characters between parts, by their
    numbers, so that different names stay different."""
    return BARRED.sub(lambda found: "".join(f"%{byte:02X}" for byte in found[0].encode()), name)


def joined(*parts):
    """The parts of a file's name, encoded; a long one ends in a digest of the whole."""
    name = SEPARATOR.join(map(encoded, parts))
    if len(name.encode(errors="surrogateescape")) <= LONGEST:
        return name
    kept = name.encode(errors="surrogateescape")[: LONGEST - 17].decode(errors="ignore")
    return f"{kept}{SEPARATOR}{digest(name)}"


def digest(text):
    return hashlib.blake2b(text.encode(errors="surrogateescape"), digest_size=8).hexdigest()


def file_name(source, scene, folder):
    """The name, without extension, of what is stored of an object in a folder: file, scene and object.

    Files in other folders may have the same name: where their outputs meet, it says whose they are.
    """
    file = Path(bpy.data.filepath)
    parts = [file.stem if bpy.data.filepath else "untitled", scene.name, source.name]
    if source.library is not None:  # a linked object's name may be that of a local one
        parts.append(source.library.name)
    if bpy.data.filepath and not folder.is_relative_to(file.parent):
        try:
            parts.append(digest(Path(os.path.relpath(file.parent, folder)).as_posix()))
        except ValueError:  # on another drive
            parts.append(digest(str(file.parent)))
    return joined(*parts)


def unsaved(folder):
    """UserError if a folder is the .blend's own, and that is not saved; else None."""
    if bpy.data.filepath or not folder.startswith("//"):
        return None
    return UserError("Save the .blend first, or choose a folder: the cache lies beside it")


def cache_path(source, scene, suffix, folder, filepath=""):
    """The absolute path of an object's cache, whose folder may be new; UserError if it cannot be used."""
    shown = filepath or folder
    refuse(unsaved(shown))
    path = Path(os.path.normpath(bpy.path.abspath(shown)))
    if not filepath:
        path = path / f"{file_name(source, scene, path)}{suffix}"
    if path.suffix.lower() != suffix:
        raise UserError("{path}: the format needs the extension {suffix}", path=path, suffix=suffix)
    folder = path.parent
    if not folder.is_dir() and (folder.exists() or not folder.parent.is_dir()):
        raise UserError("{folder}: no such folder", folder=folder)
    return path


def cache_beside(path, name):
    """The path of a carried object's cache: beside the source's cache, with both names."""
    stem = f"{path.stem}{SEPARATOR}{encoded(name)}"
    if len(stem.encode(errors="surrogateescape")) > LONGEST:
        stem = f"{path.stem[:60]}{SEPARATOR}{digest(stem)}"
    return path.with_name(stem + path.suffix)


def same_place(path):
    """A value that two paths share where they are one file, as on systems that ignore case."""
    return str(path).casefold() if sys.platform in ("win32", "darwin") else str(path)


def plays(item, path):
    """Whether an object plays the cache at that path."""
    played = points.find(item)
    if played is not None:
        item = node_group.get(played, "Points") or item
    return any(
        one.type == "MESH_CACHE" and same_place(file_of(one, item)) == same_place(path)
        for one in item.modifiers
    )


def file_of(modifier, item):
    shown = bpy.path.abspath(modifier.filepath, library=item.library)
    return Path(os.path.normpath(shown)) if modifier.filepath else Path()


def is_own(item, path, named):
    """Whether a cache at that path is an earlier bake of the object: it or its result plays it, or the name
    was made of the object's (`named`) and no other object plays it."""
    results = [entry.item for entry in results_of(item)]
    if any(plays(one, path) for one in (item, *results)):
        return True
    return named and not any(plays(one, path) for one in bpy.data.objects)


def shown_path(path):
    """A cache's path for its modifier: relative to the saved .blend where possible."""
    if bpy.data.filepath:
        with contextlib.suppress(ValueError):  # on another drive
            return bpy.path.relpath(str(path)).replace(os.sep, "/")  # readable on every system
    return str(path)


def plain(frame):
    """The frame as an integer if it is whole, else rounded: used in the names of keys."""
    return int(frame) if frame == int(frame) else round(frame, 4)


def keys_weight(points, frames):
    """Bytes in the .blend, and in memory, of so many shape keys and their basis."""
    return 12 * points * (frames + 1)


def size_text(count):
    """A number of bytes in GB, MB or kB."""
    for unit, size in (("GB", 1e9), ("MB", 1e6)):
        if count >= size:
            return f"{count / size:.1f} {unit}"
    return f"{count / 1e3:.1f} kB"


# Checks that the cache that an object plays exists and still fits it.


def cache_of(source):
    """The path of the cache that the object plays; None if it plays none."""
    modifier = modifier_stack.find_cache(source)
    return None if modifier is None else Path(bpy.path.abspath(modifier.filepath, library=source.library))


def record_of(source):
    """The record of the object's bake, parsed from JSON; {} if it is missing or invalid."""
    try:
        record = json.loads(settings_of(source).bake.record or "{}")
    except ValueError:
        return {}
    return record if isinstance(record, dict) else {}


def problem(source, look_closely=False):
    """UserError that says why the object's bake cannot be played or is of another mesh; else None.

    `look_closely`: also reads the mesh and the cache's header.
    """
    path, record = cache_of(source), record_of(source)
    if path is None:
        return None
    if not path.is_file():
        return UserError(
            "{name}: its bake {path} is not there; choose the file in its modifier, or bake again",
            source,
            path=path,
        )
    if record.get("count") not in (None, len(points_of(source.data))):
        return changed(source)
    return closely(source, path, record) if look_closely else None


def closely(source, path, record):
    from_mesh, faces = mesh_arrays.fingerprint(source.data)
    if record.get("mesh") not in (None, from_mesh.hex()) or record.get("faces") not in (None, faces):
        return changed(source)
    native.library()
    from arapfields.point_cache import PointCacheReader

    try:
        with PointCacheReader(path) as cache:
            points = cache.points
    except (ValueError, OSError) as error:
        return UserError("{name}: {error}", source, error=error)
    if record.get("points") not in (None, points):
        return UserError(
            "{name}: {path} holds {found} points; its bake had {count}",
            source,
            path=path,
            found=points,
            count=record["points"],
        )
    return None


def changed(source):
    return UserError("{name}: its mesh changed since the bake; bake again", source)
