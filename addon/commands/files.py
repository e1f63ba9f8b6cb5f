# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads and writes meshes and .blend files in the file's coordinates; outputs are replaced atomically."""

import contextlib
import errno
import os
import re
import shutil
import sys
from pathlib import Path

import bpy
import numpy as np

from ..blender import mesh_arrays
from ..blender.object_references import is_source
from ..core.errors import UserError
from ..core.files import are_whole_meshes
from .parser import FORMATS

NOTICED = 1e-6  # share of a mesh's size: a loss from single precision of which users are told
ROOM = 1 << 20  # bytes; a disk with less free space counts as full
AXES = {"forward_axis": "Y", "up_axis": "Z"}  # no conversion of axes
READ = {
    ".ply": lambda path: bpy.ops.wm.ply_import(filepath=path, **AXES),
    ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path, **AXES),
    ".stl": lambda path: bpy.ops.wm.stl_import(filepath=path, **AXES),
}


def for_blender(path):
    """The absolute path: Blender resolves relative ones from PWD, which may be another folder."""
    return os.path.abspath(path)


def check(path):
    """Returns the path; UserError if its suffix is none that can be read and written."""
    if path.suffix.lower().lstrip(".") not in FORMATS:
        known = ", ".join(f".{name}" for name in FORMATS)
        raise UserError(f"{path}: unknown extension; known are {known}")
    return path


def check_place(path):
    """UserError or OSError if no file can be written to this path, or the disk is full; before any solve."""
    from arapfields._native import OutputFile

    path.parent.mkdir(parents=True, exist_ok=True)
    OutputFile(path).discard()
    if shutil.disk_usage(path.parent).free < ROOM:
        raise full(path)


def full(path):
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def not_whole(path):
    """The error for an incomplete file, which Blender does not report."""
    if shutil.disk_usage(path.parent).free < ROOM:
        return full(path)
    return UserError(f"{path}: Blender could not write all of it; the disk may be full")


def read(path):
    """Opens a .blend, or imports a mesh file into an empty scene."""
    if not check(path).is_file():
        raise UserError(f"{path}: no such file")
    nothing = UserError(f"{path}: holds no mesh, or is damaged")
    if path.stat().st_size == 0:  # versions of Blender differ in their messages
        raise nothing
    try:
        if path.suffix.lower() == ".blend":
            bpy.ops.wm.open_mainfile(filepath=for_blender(path), load_ui=False)
            return
        bpy.ops.wm.read_homefile(use_empty=True)
        READ[path.suffix.lower()](for_blender(path))
    except RuntimeError as error:
        reason = str(error).removeprefix("Error: ").strip()
        raise UserError(f"{path}: Blender cannot read it ({reason})") from error
    if not any(is_source(item) for item in bpy.data.objects):
        raise nothing
    if loss := lost(path):
        print(f"arapfields: {loss}", file=sys.stderr, flush=True)


def lost(path):
    """A sentence on what single precision costs the coordinates of a mesh file; "" for too little."""
    meshes = [mesh_arrays.positions(item.data) for item in bpy.data.objects if is_source(item)]
    points = np.concatenate(meshes)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    off = float(np.spacing(np.abs(points).max().astype(np.float32))) / 2
    if off <= NOTICED * size:
        return ""
    return (
        f"{path}: Blender's coordinates have single precision: points are off by up to {off:.3g} of a size "
        f"of {size:.3g}; move the mesh near the origin, or use `arapfields` without Blender"
    )


def write(path, items):
    """Writes the objects to a mesh file, or all data to a .blend; the output is replaced atomically."""
    check(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() == ".blend":
        write_blend(path)
        return
    for other in list(bpy.context.selected_objects):
        other.select_set(False)
    for item in items:
        item.hide_set(False)
        item.hide_viewport = False
        item.select_set(True)
    from arapfields._files import whole_file, write_text

    text = None
    with whole_file(path) as partial:
        export(partial, items)
        if not partial.is_file() or not are_whole_meshes(partial, [item.data for item in items]):
            raise not_whole(path)
        materials = partial.with_suffix(".mtl")
        if materials.exists():
            text = materials.read_text(encoding="utf-8", errors="surrogateescape")
    if text is not None:  # after the mesh: that of an earlier one stays with it
        write_text(path.with_suffix(".mtl"), relative_textures(text, path.parent))


def export(path, items):
    where = {"filepath": for_blender(path), **AXES, "export_selected_objects": True}
    suffix = path.suffix.lower()
    if suffix == ".ply":
        bpy.ops.wm.ply_export(**where, apply_modifiers=False)
    elif suffix == ".stl":
        bpy.ops.wm.stl_export(**where, apply_modifiers=False)
    else:
        further = {"apply_modifiers": False, "path_mode": "ABSOLUTE"}
        further["export_materials"] = any(item.data.materials for item in items)
        further["export_colors"] = any(item.data.color_attributes for item in items)
        bpy.ops.wm.obj_export(**where, **further)


def relative_textures(text, folder):
    """The text of a material file, its texture paths relative to `folder`."""

    def relative(match):
        path = Path(match[2].strip())
        with contextlib.suppress(ValueError):  # another drive
            path = Path(os.path.relpath(path, folder)) if path.is_absolute() else path
        return f"{match[1]}{path.as_posix()}"

    return re.sub(r"^(\s*map_\w+\s+(?:-\w+\s+\S+\s+)*)(\S.*)$", relative, text, flags=re.M)


def write_blend(path):
    """Writes a temporary file in the same folder, so that relative paths stay valid, and renames it.

    The file is read back: Blender 5.2 does not report a truncated compressed file.
    """
    from arapfields._files import whole_file

    with whole_file(path, beside=True) as partial:
        try:
            bpy.ops.wm.save_as_mainfile(filepath=for_blender(partial), copy=True, relative_remap=True)
        except RuntimeError as error:
            if shutil.disk_usage(path.parent).free < ROOM:
                raise not_whole(path) from error
            raise UserError(f"{path}: {error}") from error
        try:
            with bpy.data.libraries.load(for_blender(partial)):
                pass
        except OSError as error:
            raise not_whole(path) from error
