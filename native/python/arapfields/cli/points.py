# SPDX-License-Identifier: GPL-3.0-or-later
"""Point sets and curves to be moved by a field, and weights of a mesh's vertices."""

import numpy as np

from .._files import existing_file, read_text, write_arrays
from .._native import InvalidInput
from .files import MESH_SUFFIXES, read_any, readable, write_moved_mesh

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
