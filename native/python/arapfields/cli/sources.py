# SPDX-License-Identifier: GPL-3.0-or-later
"""What the verbs read: meshes, splats, points and their weights."""

import numpy as np

import arapfields as af

from .._files import existing_file, read_text, write_arrays
from .._native import InvalidInput
from . import files, splat_files
from .files import MESH_SUFFIXES, read_any, readable, write_moved_mesh
from .running import with_progress

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

SOURCES = (*files.MESH_SUFFIXES, *files.STATE_SUFFIXES)


class Source:
    """An input: a mesh, splats or a saved signed distance."""

    def __init__(self, args):
        self._args = args
        self.path = existing_file(args.input, SOURCES)
        self.splats = af.GaussianSplats.load(self.path) if af.GaussianSplats.is_file(self.path) else None
        self.mesh = files.read_surface(self.path) if files.is_mesh(self.path) and not self.splats else None
        self._sdf = None if self.mesh or self.splats else files.read_sdf(self.path)

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

        files.write_moved_mesh(path, self.path, self.mesh, move)


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
    return af.MeshSdf(*files.read_mesh(path)) if files.is_mesh(path) else files.read_sdf(path)


def content(path):
    """The bytes of a file; InvalidInput if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise af.InvalidInput(f"{path}: {error.strerror}") from error
