# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads and writes meshes, point clouds, normals, SDFs and fields. Errors name the file."""

import codecs
import contextlib
import io
import logging
import re
from pathlib import Path

import numpy as np

from .. import _native
from .._files import existing_file, read_text, write_arrays
from .._interrupts import uninterrupted
from .._native import InvalidInput, ObjectStyle

MESH_SUFFIXES = (".ply", ".obj", ".stl", ".off")
CLOUD_SUFFIXES = (".ply", ".npz", ".xyz")
STATE_SUFFIXES = (".safetensors",)
OBJ_VERTEX = re.compile(r"^([ \t]*v[ \t]+)(\S+)[ \t]+(\S+)[ \t]+(\S+)", flags=re.M)
MOST_PREFERRED = 256  # largest number of preferred normals from a mesh's faces


def _trimesh():
    try:
        with uninterrupted():  # some of its modules catch Ctrl-C during import
            import trimesh
    except ImportError:
        raise ImportError("meshes need the package trimesh: pip install 'arapfields[cli]'") from None
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # our errors contain what matters
    return trimesh


@contextlib.contextmanager
def readable(path, kind):
    """Context manager: errors of readers on damaged files become InvalidInput that names the file."""
    try:
        yield
    except (InvalidInput, MemoryError):
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InvalidInput(f"{path}: not readable as {kind}, perhaps damaged ({reason})") from error


def is_mesh(path):
    return Path(path).suffix.lower() in MESH_SUFFIXES


def read_mesh(path):
    """Vertices (n, 3) and triangles (m, 3) of a file; polygons are triangulated.

    The vertices' order is the file's; equal corners of an STL are merged.
    """
    path = existing_file(path, MESH_SUFFIXES)
    trimesh = _trimesh()
    with readable(path, path.suffix[1:].upper()):
        mesh = trimesh.load(
            _stream(path),
            file_type=path.suffix[1:].lower(),
            force="mesh",
            process=False,
            maintain_order=True,
            skip_materials=True,
        )
        vertices, triangles = np.array(mesh.vertices, float), np.array(mesh.faces, np.int64)
    for name, rows in (("vertices", vertices), ("faces", triangles)):
        if len(rows) and (rows.ndim != 2 or rows.shape[1] != 3):
            raise InvalidInput(
                f"{path}: {name} are rows of shape {rows.shape[1:]}; three numbers each are needed"
            )
    if triangles.size == 0:
        raise InvalidInput(f"{path}: has no faces (or is cut off); a triangle mesh is needed")
    fits = (np.abs(vertices) <= np.finfo(np.float32).max).all(axis=1)  # files have single precision
    if not fits.all():
        first = int(np.flatnonzero(~fits)[0])
        raise InvalidInput(f"{path}: vertex {first} is NaN, infinite or beyond single precision")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InvalidInput(f"{path}: a face names a vertex beyond the {len(vertices)} there are")
    corners = vertices[triangles]
    if not np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).any():
        raise InvalidInput(f"{path}: all faces are degenerate; there is no surface")
    if path.suffix.lower() == ".stl":
        vertices, triangles = _merged(vertices, triangles)
    return vertices, triangles.astype(np.int32)


def _stream(path):
    """The path, or a stream of the text without its byte order mark, which trimesh misreads."""
    with path.open("rb") as file:
        is_marked = file.read(3).startswith((codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    is_text = path.suffix.lower() in (".obj", ".off")
    return io.BytesIO(read_text(path, "replace").encode()) if is_marked and is_text else path


def _merged(vertices, triangles):
    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    return unique, inverse.reshape(-1)[triangles]


def write_mesh(path, vertices, triangles):
    """Writes PLY, OBJ, STL or OFF by the path's extension."""
    mesh = _trimesh().Trimesh(vertices, triangles, process=False)
    mesh.export(path)


def write_moved_mesh(path, source, mesh, move):
    """Writes the mesh of the file `source` with its vertices moved by `move`, points (n, 3) → (n, 3).

    From OBJ to OBJ, polygons, texture coordinates, materials and groups are kept; normals are removed, as
    they are those of the old shape. Otherwise only positions and triangles are written.
    """
    if path.suffix.lower() == Path(source).suffix.lower() == ".obj":
        moved = moved_obj(source, move)
        if moved is not None:
            path.write_text(moved, encoding="utf-8", newline="\n", errors="surrogateescape")
            return
    vertices, triangles = mesh
    write_mesh(path, move(vertices), triangles)


def moved_obj(source, move):
    """The text of an OBJ file with its vertices moved; None if one is not finite."""
    text = read_text(source, "surrogateescape")
    text = re.sub(r"\\\r?\n", "", text)  # continued lines
    with readable(source, "OBJ"):
        before = np.array([[float(c) for c in m.groups()[1:]] for m in OBJ_VERTEX.finditer(text)])
    if not np.isfinite(before).all():
        return None
    rows = iter(move(before.reshape(-1, 3)))
    moved = OBJ_VERTEX.sub(lambda m: m[1] + " ".join(f"{c:.9g}" for c in next(rows)), text)
    moved = re.sub(r"^[ \t]*vn[ \t].*\n?", "", moved, flags=re.M)
    return re.sub(r"^[ \t]*f[ \t].*$", _without_normals, moved, flags=re.M)


def _without_normals(line):
    return re.sub(r"(\d+)/(-?\d*)/-?\d+", lambda m: f"{m[1]}/{m[2]}".rstrip("/"), line[0])


def write_cloud(path, points, normals):
    """Writes points (n, 3) with normals (n, 3) as binary PLY, NPZ (`points`, `normals`), or rows of text."""
    suffix = path.suffix.lower()
    if suffix == ".npz":
        write_arrays(path, points=points, normals=normals)
        return
    rows = np.ascontiguousarray(np.hstack([points, normals]))
    if suffix == ".xyz":
        np.savetxt(path, rows, fmt="%.9g")
        return
    properties = "".join(f"property double {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    path.write_bytes(header.encode() + rows.astype("<f8").tobytes())


def read_sdf(path):
    """A NeuralSdf written by `fit`."""
    return _native.NeuralSdf.load(existing_file(path, STATE_SUFFIXES))


def read_field(path):
    """A DeformationField written by `deform` or `stylize`."""
    return _native.DeformationField.load(existing_file(path, STATE_SUFFIXES))


def read_normals(path):
    """Preferred normals (k, 3): a mesh's distinct face normals, or the rows of a text file or .npy array."""
    path = existing_file(path, (*MESH_SUFFIXES, ".txt", ".csv", ".npy"))
    if is_mesh(path):
        return _face_normals(path)
    with readable(path, "rows of three numbers"):
        if path.suffix.lower() == ".npy":  # memory-mapped, which checks its size against the file's
            normals = np.array(np.lib.format.open_memmap(path, mode="r"), float)
        else:
            normals = np.loadtxt(read_text(path).replace(",", " ").splitlines(), ndmin=2)
    if normals.ndim != 2 or normals.shape[1] != 3 or len(normals) == 0:
        raise InvalidInput(
            f"{path}: holds an array of shape {normals.shape}; rows of three numbers are needed"
        )
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if not (np.isfinite(lengths).all() and (lengths > 0).all()):
        raise InvalidInput(f"{path}: a normal is zero or not finite; each must have a direction")
    return normals / lengths


def read_style_object(path):
    """The ObjectStyle of a mesh file."""
    vertices, triangles = read_mesh(existing_file(path, MESH_SUFFIXES))
    try:
        return ObjectStyle(vertices, triangles)
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error


def _face_normals(path):
    vertices, triangles = read_mesh(path)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 0] / lengths[lengths > 0, None]
    distinct = np.empty((0, 3))
    for normal in normals:
        if len(distinct) == 0 or (distinct @ normal).max() < 0.9995:  # 1.8 degrees
            distinct = np.vstack([distinct, normal])
        if len(distinct) > MOST_PREFERRED:
            raise InvalidInput(
                f"{path}: has over {MOST_PREFERRED} distinct face normals; a simpler mesh is needed"
            )
    return distinct
