# SPDX-License-Identifier: GPL-3.0-or-later
"""Signed distances on a regular grid, as arrays, .npz files and OpenVDB volumes."""

import errno
import importlib
import importlib.util
import os
import sys
from pathlib import Path
from typing import Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from ._files import whole_file, write_arrays
from ._native import Cancelled, Frame, InvalidInput, Task, real_array, require_memory
from ._options import options_of
from .arrays import ArrayLike

SUFFIXES = (".npz", ".vdb")
CHUNK = 200_000  # points evaluated between two checks for cancellation
RESOLUTION = options_of("grid")["resolution"]
BAND = 3  # half width of the level set's narrow band, in voxels


Array: TypeAlias = npt.NDArray[np.float64]
FilePath: TypeAlias = str | os.PathLike[str]


class Distance(Protocol):
    """A function of points (p, 3) → (p,) with a `frame`."""

    @property
    def frame(self) -> Frame: ...

    def __call__(self, points: Array, /) -> ArrayLike: ...


def _checked_bounds(bounds: ArrayLike) -> Array:
    """The bounds as a (2, 3) array; InvalidInput if they are not a low and a high corner."""
    corners = real_array(bounds, "bounds")
    if corners.shape != (2, 3) or not np.isfinite(corners).all() or not (corners[0] < corners[1]).all():
        raise InvalidInput(f"bounds: got {bounds!r:.80}; low and high corner, shape (2, 3), are needed")
    return corners


def sdf_grid(
    sdf: Distance,
    resolution: int = RESOLUTION["default"],
    *,
    bounds: ArrayLike | None = None,
    task: Task | None = None,
) -> tuple[npt.NDArray[np.float32], Array, float]:
    """Distances at the nodes of a regular grid: (values, origin, spacing).

    `values` (nx, ny, nz) float32, negative inside; node (i, j, k) lies at origin + spacing · (i, j, k), in
    the coordinates of `sdf`, a NeuralSdf, a MeshSdf or any function of points (p, 3) → (p,) with a `frame`.
    `resolution` cells span the longest side of `bounds` ((2, 3): low and high corner; without it the
    frame's cube).
    InvalidInput for an invalid resolution or bounds; Cancelled if `task` is cancelled.
    """
    low, high = RESOLUTION["low"], RESOLUTION["high"]
    if not isinstance(resolution, (int, np.integer)) or not low <= resolution <= high:
        raise InvalidInput(f"resolution: got {resolution!r}; an integer from {low} to {high} is needed")
    if not isinstance(task, Task | None):
        raise InvalidInput(f"task: got {type(task).__name__}; a Task or None is needed")
    corners = sdf.frame.to_mesh([[-1.0] * 3, [1.0] * 3]) if bounds is None else _checked_bounds(bounds)
    size = corners[1] - corners[0]
    spacing = float(size.max() / resolution)
    counts = np.maximum(np.ceil(size / spacing - 1e-9).astype(int), 1) + 1
    require_memory("resolution", 4.0 * float(np.prod(counts, dtype=float)))
    values = np.empty(counts, np.float32)
    flat = values.reshape(-1)
    for begin in range(0, flat.size, CHUNK):
        if task is not None:
            if task.cancelled:
                raise Cancelled("cancelled")
            task.report(begin / flat.size, "distances")
        nodes = np.stack(np.unravel_index(np.arange(begin, min(begin + CHUNK, flat.size)), counts), axis=1)
        distances = np.asarray(sdf(corners[0] + spacing * nodes))
        if distances.shape != (len(nodes),):
            raise InvalidInput(
                f"sdf: shape {distances.shape} for {len(nodes)} points; one number each is needed"
            )
        if not (np.abs(distances) <= np.finfo(np.float32).max).all():
            raise InvalidInput("sdf: a distance is NaN, infinite or beyond single precision")
        flat[begin : begin + CHUNK] = distances
    return values, corners[0], spacing


def save_grid(path: FilePath, values: ArrayLike, origin: ArrayLike, spacing: float) -> None:
    """Writes a grid of sdf_grid as .npz (`values`, `origin`, `spacing`) or .vdb, by the path's extension.

    A .vdb contains one float grid, `surface`: a level set with a narrow band of BAND voxels on each side.
    ImportError without an openvdb module; InvalidInput for another extension, or values that are not a grid
    of finite numbers.
    """
    values, origin, spacing = _checked_grid(values, origin, spacing)
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InvalidInput(f"{path}: unknown extension; allowed are {', '.join(SUFFIXES)}")
    for name, given in (("values", values), ("origin", origin), ("spacing", spacing)):
        if np.asarray(given).dtype.kind not in "biuf":
            raise InvalidInput(f"{name}: dtype {np.asarray(given).dtype}; expected real numbers")
    openvdb = openvdb_module() if suffix == ".vdb" else None
    with whole_file(path) as partial:
        if openvdb is None:
            write_arrays(partial, values=values, origin=origin, spacing=spacing)
        else:
            _write_vdb(openvdb, partial, path, values, origin, spacing)


def _checked_grid(values, origin, spacing):
    """The arguments as arrays; `values` keep their type."""
    numbers, corner, step = (
        real_array(given, name)
        for given, name in ((values, "values"), (origin, "origin"), (spacing, "spacing"))
    )
    if numbers.ndim != 3 or not numbers.size or not np.isfinite(numbers).all():
        raise InvalidInput(f"values: shape {numbers.shape}; finite numbers (nx, ny, nz) are needed")
    if corner.shape != (3,) or not np.isfinite(corner).all():
        raise InvalidInput(f"origin: got {origin!r:.80}; three finite numbers are needed")
    if step.shape not in ((), (1,)) or not 0 < float(step.reshape(())) < np.inf:
        raise InvalidInput(f"spacing: got {spacing!r:.80}; a positive number is needed")
    kept = values if isinstance(values, np.ndarray) else numbers
    return kept, corner, float(step.reshape(()))


def openvdb_module():
    """OpenVDB's Python module, also Blender's or that of an installed `bpy`; ImportError without one."""
    try:
        return importlib.import_module("openvdb")
    except ImportError:
        pass
    found = importlib.util.find_spec("bpy")
    for place in (found and found.submodule_search_locations) or []:
        for library in Path(place).glob("*/python/lib/python3*/site-packages/openvdb*"):
            sys.path.append(str(library.parent))
            try:
                return importlib.import_module("openvdb")
            except ImportError:
                continue
            finally:
                sys.path.remove(str(library.parent))
    raise ImportError("writing .vdb needs the module openvdb: run inside Blender, or install the package bpy")


def _write_vdb(openvdb, partial, path, values, origin, spacing):
    band = BAND * spacing
    grid = openvdb.FloatGrid(band)
    grid.copyFromArray(np.clip(values, -band, band).astype(np.float32))
    grid.name = "surface"
    grid.gridClass = openvdb.GridClass.LEVEL_SET
    matrix = np.diag([spacing] * 3 + [1.0])
    matrix[3, :3] = origin  # OpenVDB multiplies row vectors
    grid.transform = openvdb.createLinearTransform(matrix.tolist())
    # OpenVDB does not report a full disk: the file is read back.
    try:
        openvdb.write(str(partial), grids=[grid])
        arrived = openvdb.read(str(partial), grid.name)
    except Exception as error:
        raise OSError(errno.EIO, f"not written whole ({error}); the disk may be full", str(path)) from error
    if arrived.activeVoxelCount() != grid.activeVoxelCount():
        raise OSError(errno.EIO, "not written whole; the disk may be full", str(path))
