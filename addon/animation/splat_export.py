# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats as files: of one shape, or of the frames of a bake."""

import re
import shutil
import tempfile
from pathlib import Path

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import world_matrix
from ..blender.host import has_window
from ..blender.language import translated
from ..blender.object_references import source_of
from ..blender.property_definitions import flag, path_text, text
from ..blender.source_operator import SourceOperator
from ..blender.splat_layouts import holds_splats
from ..core.errors import UserError, as_user_error, refuse
from ..core.runtime import native
from ..results import placement
from ..solver import secondary_motion
from . import caches
from .caches import OutputFolder, plain, size_text
from .object_bake import ObjectBake

# Files of splats: of one shape, or of the frames of a bake.

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


# Bakes a posed scan of splats to files, as its modifier shows it, in world space.


class SplatBake(ObjectBake):
    """Writes files, which nothing in the scene plays; the object stays as it is."""

    def __init__(self, context, source, kind, frames, path, part=None, loop=False):
        if part is not None and part[1] > 1:
            raise UserError("{name}: splats are not baked in parts; bake it whole", source)
        refuse(placement.placement_refusal(source))
        native.library()
        require_writable(path)
        super().__init__(context, source, kind, frames, path, loop=loop)
        fps = secondary_motion.frame_rate(context.scene)
        self.store = SplatFiles(path, frames, fps, source.name)
        self.worlds, self.kept = {}, 0  # world matrices, by frame; how many frames are stored

    def request(self, context):
        asked = super().request(context)
        frame = context.scene.frame_current + context.scene.frame_subframe
        self.worlds[round(frame, 3)] = np.array(world_matrix(self.reference.get()))
        return asked

    def keep(self, shape):
        frame = self.frames.start + self.kept * self.frames.step
        surface, self.kept = self.reader.surface, self.kept + 1
        splats = surface.splats.posed(native.library(), shape.points, shape.changes)
        self.store.add(splats.transformed(self.worlds.pop(round(frame, 3))))

    def place(self, context):
        self.unchanged_source()
        self.store.commit()
        yield from ()
        ends = dict.fromkeys((self.store.written[0].name, self.store.written[-1].name))
        values = {"count": self.frames.count, "path": " – ".join(ends), "size": size_text(self.store.size)}
        return translated("{count} frames of splats written to {path} ({size})", **values)


KNOWN = (".ply", ".glb", ".usdc", ".usda", ".usd")


class ARAPFIELDS_OT_export_splats(SourceOperator, bpy.types.Operator):
    """Write the splats as the modifier shows them: their locations, shapes and colors, in world space"""

    bl_label = "Export Splats"
    guide = "animation"
    of_linked = True

    __annotations__ = {
        "filepath": path_text(
            "File",
            "A .ply, a .glb, or .usdc where this Blender's USD knows splats",
            "FILE",
            options={"SKIP_SAVE"},
        ),
        "filter_glob": text(
            "Filter",
            "Files that are shown",
            default=";".join(f"*{suffix}" for suffix in KNOWN),
            options={"HIDDEN"},
        ),
        "check_existing": flag(
            "Check Existing", "Ask before a file is replaced", default=True, options={"HIDDEN", "SKIP_SAVE"}
        ),
    }

    @classmethod
    def refuses(cls, source):
        return None if holds_splats(source) else UserError("{name} holds no splats", source)

    def invoke(self, context, event):
        """Opens the file browser if no path is given."""
        if self.filepath or not has_window():
            return self.execute(context)
        folder = Path(bpy.path.abspath("//"))
        self.filepath = str(folder / f"{caches.encoded(source_of(context).name)}.ply")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def change(self, context, source):
        if not self.filepath:
            raise UserError("Choose a file")
        path = caches.cache_path(
            source, context.scene, Path(self.filepath).suffix.lower(), "//", self.filepath
        )
        if path.suffix.lower() not in KNOWN:
            raise UserError("{path}: unknown extension; known are {known}", path=path, known=", ".join(KNOWN))
        native.library()
        require_writable(path)
        splats = shown(context, source)
        write(path, splats, source.name)
        values = {
            "count": f"{len(splats):,}",
            "path": path.name,
            "size": caches.size_text(path.stat().st_size),
        }
        return translated("{count} splats written to {path} ({size})", **values)


def shown(context, source):
    """The native GaussianSplats of an object right after the field's modifier, in world space."""
    own = modifier_stack.find(source)
    kept = [] if own is None else list(source.modifiers)[: source.modifiers.find(own.name) + 1]
    with modifier_stack.mesh_of(context, source, kept) as mesh:
        splats = mesh_arrays.arrays_of(source, mesh).splats
    if splats is None:
        raise UserError("{name}: a modifier before the field makes something else of its splats", source)
    return splats.made(native.library()).transformed(np.array(world_matrix(source)))


CLASSES = [
    ARAPFIELDS_OT_export_splats,
]
