# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes splats by a file's extension: PLY, glTF or USD."""

from . import usd

FRAMED = (".ply", ".glb")  # of which each frame is a file
SUFFIXES = (*FRAMED, *usd.SUFFIXES)


def require_writable(path):
    """ImportError if a package that the path's format needs is missing or too old."""
    if path.suffix.lower() in usd.SUFFIXES:
        usd.require_usd_splats()


def write(path, splats, *, up="z", name="Splats", task=None):
    """Writes GaussianSplats to one file. glTF's y is up: splats whose z is up are turned for it, with their
    colours. USD has the axis in its header; PLY has none."""
    suffix = path.suffix.lower()
    if suffix == ".glb":
        splats.save_gltf(path, name, up=up, task=task)
    elif suffix in usd.SUFFIXES:
        file = usd.SplatFile(path, up=up, name=name)
        file.add(splats)
        file.finish()
    else:
        splats.save(path, task=task)
