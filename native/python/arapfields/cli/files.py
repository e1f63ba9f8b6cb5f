# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads and writes meshes, point clouds, normals, SDFs and fields. Errors name the file."""

import contextlib
from pathlib import Path

import numpy as np

from .. import _native
from .._files import existing_file, read_text, write_arrays
from .._native import InvalidInput, ObjectStyle
from .._streams import say
from .meshes import formats
from .meshes.mesh import Mesh

MESH_SUFFIXES = tuple(formats.FORMATS)
CLOUD_SUFFIXES = (".ply", ".npz", ".xyz")
STATE_SUFFIXES = (".safetensors",)
MOST_PREFERRED = 256  # largest number of preferred normals from a mesh's faces


@contextlib.contextmanager
def readable(path, kind):
    """Context manager: errors of readers on damaged files become InvalidInput that names the file."""
    try:
        yield
    except (InvalidInput, MemoryError, ImportError):
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InvalidInput(f"{path}: not readable as {kind}, perhaps damaged ({reason})") from error


def is_mesh(path):
    return Path(path).suffix.lower() in MESH_SUFFIXES


def read_mesh(path):
    """Vertices (n, 3) and triangles (m, 3) of a file; see read_surface."""
    return read_surface(path).surface


def read_surface(path):
    """The Mesh of a file that has polygons with an area.

    The vertices and their order are the file's; equal corners of an STL are one vertex.
    """
    path = existing_file(path, MESH_SUFFIXES)
    mesh = read_any(path)
    if len(mesh.triangles) == 0:
        raise InvalidInput(f"{path}: has no faces (or is cut off); a triangle mesh is needed")
    corners = mesh.vertices[mesh.triangles]
    if not np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).any():
        raise InvalidInput(f"{path}: all faces are degenerate; there is no surface")
    return mesh


def read_any(path):
    """The Mesh of a file, which may have points or curves alone."""
    with readable(path, path.suffix[1:].upper()):
        return formats.read(path)


def write_mesh(path, vertices, triangles):
    """Writes PLY, OBJ, STL or OFF by the path's extension."""
    triangles = np.asarray(triangles, np.int64)
    sizes = np.full(len(triangles), 3)
    _tell(formats.write(path, Mesh(np.asarray(vertices, float), sizes, triangles.reshape(-1))))


def write_moved_mesh(path, source, mesh, move):
    """Writes the Mesh of the file `source` with its vertices moved by `move`, points (n, 3) → (n, 3).

    In the source's format all else is kept, but for normals, as they are those of the old shape. In others
    polygons, colours and texture coordinates are kept where the format has a place for them.
    """
    moved = np.asarray(move(mesh.vertices), float)
    _tell(formats.write_moved(path, Path(source).suffix, mesh, moved))


def tell_loss(path, points):
    """Says what positions like these lose in a format of single precision."""
    if loss := formats.lost(points):
        _tell(f"{path.name}: {loss}")


def _tell(loss):
    """Prints what a file has lost; `--quiet` does not hide it."""
    if loss:
        say(f"note: {loss}")


def write_cloud(path, points, normals):
    """Writes points (n, 3) with normals (n, 3) as binary PLY, NPZ (`points`, `normals`), or rows of text."""
    suffix = path.suffix.lower()
    if suffix == ".npz":
        write_arrays(path, points=points, normals=normals)
        return
    rows = np.ascontiguousarray(np.hstack([points, normals]))
    if suffix == ".xyz":
        np.savetxt(path, rows, fmt="%.17g")
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
