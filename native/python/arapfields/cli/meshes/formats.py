# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files by their extensions."""

import numpy as np

from . import obj, off, ply, stl

FORMATS = {".ply": ply, ".obj": obj, ".stl": stl, ".off": off}
NOTICED = 1e-6  # share of a mesh's size: a loss from single precision of which users are told


def read(path):
    """The Mesh of a file, perhaps without polygons; InvalidInput names what in a file cannot be read."""
    return FORMATS[path.suffix.lower()].read(path)


def write(path, mesh):
    """Writes a Mesh by the path's extension; what that format cannot hold is left out.

    Returns what is lost by rounding to single precision (see lost).
    """
    rounds = FORMATS[path.suffix.lower()].write(path, mesh)
    return lost(mesh.vertices) if rounds else ""


def write_moved(path, suffix, mesh, vertices):
    """Writes a Mesh that was read from a file with this suffix, with other positions; returns as write.

    In the same format all else of the file stays, but for normals.
    """
    if path.suffix.lower() != suffix.lower():
        return write(path, mesh.moved(vertices))
    return lost(vertices) if mesh.document.write(path, vertices) else ""


def lost(points):
    """A sentence on what points (n, 3) lose in single precision; empty where that is too little to see."""
    if len(points) == 0:
        return ""
    off = float(np.abs(points.astype(np.float32).astype(float) - points).max())
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if off <= NOTICED * size:
        return ""
    return (
        f"single precision, as this format has, moves points by up to {off:.3g} of a size of {size:.3g}; "
        "OBJ, OFF and a PLY with properties of type double keep all digits"
    )
