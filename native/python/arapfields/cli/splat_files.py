# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes splats by a file's extension: PLY, glTF or USD."""

import numpy as np

from .._native import GaussianSplats
from . import usd

FRAMED = (".ply", ".glb")  # of which each frame is a file
SUFFIXES = (*FRAMED, *usd.SUFFIXES)
FROM_Z_UP = ((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1))  # to glTF's axes, of which y is up


def require_writable(path):
    """ImportError if a package that the path's format needs is missing or too old."""
    if path.suffix.lower() in usd.SUFFIXES:
        usd.require_usd_splats()


def write(path, splats, *, up="z", name="Splats", task=None):
    """Writes GaussianSplats to one file. glTF's y is up: splats whose z is up are turned for it, with their
    colours. USD has the axis in its header; PLY has none."""
    suffix = path.suffix.lower()
    if suffix == ".glb":
        splats = with_y_up(splats) if up == "z" else splats
        splats.save_gltf(path, name, task=task)
    elif suffix in usd.SUFFIXES:
        file = usd.SplatFile(path, up=up, name=name)
        file.add(splats)
        file.finish()
    else:
        splats.save(path, task=task)


def with_y_up(splats):
    """Splats whose z is up, turned to glTF's axes. Their own axes are exchanged too, as Blender's importer
    does on the way back, so that it gives the same rotations and scales."""
    turned, (w, x, y, z) = splats.transformed(FROM_Z_UP), splats.rotations.T
    rotations, scales = np.column_stack([w, x, z, -y]), splats.scales[:, [0, 2, 1]]
    return GaussianSplats(turned.centers, rotations, scales, splats.opacities, turned.harmonics)
