# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads and writes meshes, point clouds, normals, SDFs and fields. Errors name the file."""

import contextlib
from pathlib import Path

import numpy as np

import arapfields as af

from .. import _native
from .._files import existing_file, read_text, write_arrays
from .._native import InvalidInput, ObjectStyle
from .._streams import say
from . import splat_files
from .command_line import with_progress
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


# What the verbs read: meshes, splats, points and their weights.

# Point sets and curves to be moved by a field, and weights of a mesh's vertices.

TEXT_SUFFIXES = (".xyz", ".txt", ".csv")
ARRAY_SUFFIXES = (".npy", ".npz")
WARPED = (*MESH_SUFFIXES, *TEXT_SUFFIXES, *ARRAY_SUFFIXES)


def warped(source):
    """A function write(path, move) that writes the moved points of `source` to a path.

    For meshes, curves and points of mesh files the rest of the file is kept; point sets are rows x y z.
    """
    source = existing_file(source, WARPED)
    suffix = source.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        points = _rows(source)
        if len(points) == 0 or not np.isfinite(points).all():
            raise InvalidInput(f"{source}: has no points, or NaN or infinite ones; finite points are needed")
        return lambda path, move: _write_points(path, move(points))
    mesh = read_any(source)
    if len(mesh.vertices) == 0:
        raise InvalidInput(f"{source}: has no vertices; points, curves or a mesh are needed")
    is_surface = len(mesh.triangles) > 0

    def write(path, move):
        if is_surface or path.suffix.lower() == suffix:
            write_moved_mesh(_with(path, MESH_SUFFIXES, "a mesh"), source, mesh, move)
        elif suffix == ".obj":
            _with(path, (".obj",), "curves")
        else:
            _write_points(path, move(mesh.vertices))

    return write


def _with(path, suffixes, what):
    if path.suffix.lower() not in suffixes:
        raise InvalidInput(f"--output: {path.name} is no place for {what}; use {', '.join(suffixes)}")
    return path


def _rows(path):
    """Points (n, 3) of an array, or of rows of text, in which normals may follow."""
    suffix = path.suffix.lower()
    with readable(path, "points"):
        if suffix == ".npz":
            with np.load(path) as arrays:
                if "points" not in arrays:
                    raise InvalidInput(f"{path}: has no array 'points'")
                rows = np.array(arrays["points"], float)
        else:
            rows = read_numbers(path)
    if rows.ndim != 2 or rows.shape[1] not in (3, 6):
        raise InvalidInput(
            f"{path}: holds an array of shape {rows.shape}; rows of three numbers, or of six with normals, "
            "are needed"
        )
    return rows[:, :3]


def _write_points(path, points):
    suffix = path.suffix.lower()
    if suffix == ".npz":
        write_arrays(path, points=points)
    elif suffix == ".npy":
        with path.open("wb") as file:
            np.save(file, points)
    elif suffix in TEXT_SUFFIXES:
        np.savetxt(path, points, fmt="%.17g", delimiter="," if suffix == ".csv" else " ")
    else:
        _with(path, (".ply",), "points")
        header = "".join(f"property double {name}\n" for name in "xyz")
        text = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{header}end_header\n"
        path.write_bytes(text.encode() + np.ascontiguousarray(points, "<f8").tobytes())


def read_numbers(path):
    """Rows of numbers from a .npy array, or from text separated by spaces or commas."""
    if path.suffix.lower() == ".npy":
        return np.array(np.lib.format.open_memmap(path, mode="r"), float)
    return np.loadtxt(read_text(path).replace(",", " ").splitlines(), ndmin=2)


def read_weights(path, vertices):
    """(vertices,) weights ≥ 0 from the rows of a text file, or a .npy array."""
    path = existing_file(path, (*TEXT_SUFFIXES[1:], ".npy"))
    with readable(path, "numbers"):
        if path.suffix.lower() == ".npy":
            numbers = np.array(np.lib.format.open_memmap(path, mode="r"), float)
        else:
            numbers = np.loadtxt(read_text(path).replace(",", " ").split(), ndmin=1)
    if numbers.shape != (vertices,):
        raise InvalidInput(
            f"{path}: holds {numbers.size} numbers; one for each of the {vertices} vertices is needed"
        )
    if not (np.isfinite(numbers).all() and (numbers >= 0).all() and (numbers > 0).any()):
        raise InvalidInput(f"{path}: numbers are negative, not finite or all 0; some must be above 0")
    return numbers


# Inputs of verbs by kind.

SOURCES = (*MESH_SUFFIXES, *STATE_SUFFIXES)


class Source:
    """An input: a mesh, splats or a saved signed distance."""

    def __init__(self, args):
        self._args = args
        self.path = existing_file(args.input, SOURCES)
        self.splats = af.GaussianSplats.load(self.path) if af.GaussianSplats.is_file(self.path) else None
        self.mesh = read_surface(self.path) if is_mesh(self.path) and not self.splats else None
        self._sdf = None if self.mesh or self.splats else read_sdf(self.path)

    def sdf(self):
        if self.splats:
            raise af.InvalidInput(f"{self.path}: holds splats; a mesh or a signed distance is needed")
        if self._sdf is None:
            exact = self._args.sdf == "exact"
            self._sdf = self.distances() if exact else fitted(*self.mesh.surface, af.FitOptions(), self._args)
        return self._sdf

    def distances(self):
        return af.MeshSdf(*self.mesh.surface) if self.mesh else self._sdf

    def write_moved(self, path, field, finish=None):
        """Writes the mesh or splats moved by a field.

        `finish(vertices, triangles, moved)` gives a mesh's final positions.
        """
        if self.splats:
            moved = field.apply_to(self.splats)
            splat_files.write(path, moved, up=self._args.up_axis, name=self.path.stem)
            return

        def move(vertices):
            moved = field(vertices)
            return moved if finish is None else finish(vertices, self.mesh.triangles, moved)

        write_moved_mesh(path, self.path, self.mesh, move)


def fitted(vertices, triangles, options, args):
    return with_progress("fit", lambda task: af.fit_sdf(vertices, triangles, options, task=task), args.quiet)


def samples(source, count, seed, args):
    painted = {name: getattr(args, name) for name in ("weights", "bend_weights") if getattr(args, name, None)}
    if source.mesh:
        count_of = len(source.mesh.vertices)
        weights = {name: read_weights(path, count_of) for name, path in painted.items()}
        return af.sample_mesh(*source.mesh.surface, count, seed=seed, **weights)
    if painted:
        flag = "--" + next(iter(painted)).replace("_", "-")
        raise af.InvalidInput(
            f"{flag}: {source.path} has no vertices that numbers could be of; a mesh is needed"
        )
    if source.splats:
        return with_progress(
            "sample", lambda task: af.sample_splats(source.splats, count, task=task), args.quiet
        )
    return with_progress(
        "sample", lambda task: af.sample_surface(source.sdf(), count=count, seed=seed, task=task), args.quiet
    )


def read_distance(path):
    """The exact distance of a mesh, or a signed distance written by `fit`."""
    path = existing_file(path, SOURCES)
    return af.MeshSdf(*read_mesh(path)) if is_mesh(path) else read_sdf(path)


def content(path):
    """The bytes of a file; InvalidInput if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise af.InvalidInput(f"{path}: {error.strerror}") from error
