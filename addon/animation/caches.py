# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the frames of a bake go, and what they weigh."""

import contextlib
import os
import re
from pathlib import Path

import bpy

from ..blender.language import translated
from ..core.errors import UserError, as_user_error
from ..core.runtime.coroutines import Pause
from ..field_modifier import cache_modifier
from ..results import result_objects

SUFFIXES = {"PC2": ".pc2", "MDD": ".mdd"}
BARRED = re.compile(r'[\x00-\x1f/\\:*?"<>|]')  # letters that a file's name cannot have
HEAVY = 500e6  # bytes of shape keys, above which a cache would serve better


class ShapeKeys:
    """The frames of one object, kept in memory for its shape keys."""

    def __init__(self):
        self.shapes, self.item = [], None  # item: an object that no scene has, with the keys

    def open(self, solver):
        """Before the first frame; on the worker, as all but `commit`."""

    def add(self, points):
        self.shapes.append(points)

    def finish(self):
        """After the last frame."""

    def discard(self):
        self.shapes.clear()

    def make(self, mesh, frames, job):
        """Coroutine on the main thread: an object of that mesh with a shape key a frame."""
        self.item, names = bpy.data.objects.new(mesh.name, mesh), [plain(frame) for frame in frames]
        for number, frame in enumerate(names):
            text = translated("Storing frame {frame}", frame=frame)
            job.report_main_thread(number / len(names), text)
            result_objects.add_frame(self.item, names, number, self.shapes[number])
            self.shapes[number] = None  # the key has it
            yield Pause.REDRAW

    def forget(self):
        """Another object has the mesh now."""
        bpy.data.objects.remove(self.item)
        self.item = None

    def discard_item(self):
        """Removes what no other object has; on the main thread."""
        if self.item is not None:
            with contextlib.suppress(ReferenceError):  # the file was left
                result_objects.discard(self.item)


class CacheFile:
    """The frames of one object in a point cache, which takes its place when it is committed."""

    def __init__(self, path, frames, fps):
        self.path, self.frames, self._fps = path, frames, fps
        self._writer = None

    def discard_item(self):
        """There is none."""

    def open(self, solver):
        self.open_for(len(solver.rest))

    def open_for(self, points):
        """For so many points."""
        from arapfields.point_cache import PointCacheWriter

        frames, times = self.frames, {"start": self.frames.start, "step": self.frames.step, "fps": self._fps}
        self._writer = PointCacheWriter(self.path, points, frames.count, **times)

    def add(self, points):
        self._writer.write(points)

    def finish(self):
        self._writer.finish()

    def commit(self):
        """Puts the cache in its place; on the main thread."""
        try:
            self._writer.commit()
        except OSError as error:
            raise as_user_error(error) from error

    def discard(self):
        """Removes what is not in its place; the cache of an earlier bake stays as it is."""
        if self._writer is not None:
            self._writer.discard()

    def play_on(self, item):
        """Has an object play the cache."""
        cache_modifier.play(item, shown_path(self.path), self.frames.start, self.frames.step)


def cache_path(source, suffix, folder, filepath=""):
    """The absolute path of an object's cache; UserError where none can be."""
    name = BARRED.sub("_", source.name)
    shown = filepath or f"{folder.rstrip('/') or '/'}/{name}{suffix}"
    if shown.startswith("//") and not bpy.data.filepath:
        raise UserError("Save the .blend first, or choose a folder: the cache lies beside it")
    path = Path(bpy.path.abspath(shown))
    if path.suffix.lower() != suffix:
        raise UserError("{path}: the format needs the extension {suffix}", path=path, suffix=suffix)
    try:
        path.parent.mkdir(exist_ok=True)
    except (FileNotFoundError, FileExistsError, NotADirectoryError):
        raise UserError("{folder}: no such folder", folder=path.parent) from None
    return path


def cache_beside(path, name):
    """The same as cache_path, of an object that goes along: beside the other's cache, with both names."""
    return path.with_name(f"{path.stem} {BARRED.sub('_', name)}{path.suffix}")


def shown_path(path):
    """A cache's path as its modifier has it: from where the .blend lies by now."""
    if bpy.data.filepath:
        with contextlib.suppress(ValueError):  # on another drive
            return bpy.path.relpath(str(path)).replace(os.sep, "/")  # as other systems read it, too
    return str(path)


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
