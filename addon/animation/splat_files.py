# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of splats: of one shape, or of the frames of a bake."""

import re
import shutil
import tempfile
from pathlib import Path

from ..core.errors import UserError, as_user_error
from .caches import OutputFolder, plain

SUFFIXES = {"PLY": ".ply", "GLTF": ".glb", "USD": ".usdc"}
IN_ONE = {".usdc"}  # of files that hold all frames
DIGITS = 4  # of a frame's number in a file's name


def frame_name(path, frame):
    """The name of a frame's file: Scan.0012.ply; of a subframe Scan.0012.5.ply."""
    whole, part = divmod(plain(frame), 1)
    number = f"{int(whole):0{DIGITS}d}" + (f"{part:.4f}".rstrip("0")[1:] if part else "")
    return f"{path.stem}.{number}{path.suffix}"


def frames_there(path):
    """The files of an earlier bake of frames to this path."""
    named = re.compile(rf"{re.escape(path.stem)}\.-?\d{{3,}}(\.\d+)?{re.escape(path.suffix)}")
    return sorted(one for one in path.parent.glob("*") if named.fullmatch(one.name))


def require_writable(path):
    """UserError if this Blender lacks what the path's format needs."""
    from arapfields.cli import splat_files

    try:
        splat_files.require_writable(path)
    except ImportError as error:
        raise UserError("{error}", error=error) from error


def write(path, splats, name):
    """Writes GaussianSplats by the path's extension; z is up."""
    from arapfields.cli import splat_files

    splat_files.write(path, splats, name=name)


class SplatFiles:
    """The store of a bake's frames of splats, which `commit` moves to their places."""

    def __init__(self, path, frames, fps, name):
        self.path, self.frames, self._fps, self._name = path, frames, fps, name
        self._stage, self._folder, self._output = None, None, OutputFolder(path.parent)
        self.written, self.size = [], 0

    def discard_item(self):
        """Does nothing: there is no temporary object."""

    def open(self, solver):
        """Called before the first frame; on the worker, as all methods but `commit`."""
        self._output.make()
        self._folder = Path(tempfile.mkdtemp(prefix=f".{self.path.stem[:40]}-", dir=self.path.parent))
        if self.path.suffix in IN_ONE:
            from arapfields.cli import usd

            times = {"fps": self._fps, "start": self.frames.start, "step": self.frames.step}
            self._stage = usd.SplatFile(self._folder / self.path.name, up="z", name=self._name, **times)

    def add(self, splats):
        if self._stage is not None:
            self._stage.add(splats)
            return
        frame = self.frames.start + len(self.written) * self.frames.step
        place = self._folder / frame_name(self.path, frame)
        write(place, splats, self._name)
        self.written.append(place)

    def finish(self):
        if self._stage is not None:
            self._stage.finish()
            self.written.append(self._stage.path)

    def commit(self):
        """Moves the files to their places; on the main thread."""
        try:
            for place in self.written:
                self.size += place.stat().st_size
                place.replace(self.path.parent / place.name)
            self._folder.rmdir()
        except OSError as error:
            raise as_user_error(error) from error

    def discard(self):
        """Removes what is not committed, and the new folder; files of an earlier bake stay."""
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
        self._output.remove_if_unused()
