# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh of a file, whatever its format."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..._native import InvalidInput
from .triangulation import triangulated

MOST = np.finfo(np.float32).max  # files and caches in single precision hold nothing beyond


@dataclass
class Mesh:
    """Vertices and polygons in a file's order, and what of its other data several formats can hold.

    `document` is the file in its own form. Its write(path, vertices) writes the same file with other
    positions, and returns whether these are rounded to single precision.
    """

    vertices: np.ndarray  # (n, 3) float64
    sizes: np.ndarray  # (m,) numbers of corners of the polygons
    corners: np.ndarray  # (sum of sizes,) the vertices at the corners, polygon by polygon
    colours: np.ndarray | None = None  # (n, 4) of vertices: red, green, blue, alpha between 0 and 1
    face_colours: np.ndarray | None = None  # (m, 4) of polygons
    texture: np.ndarray | None = None  # (sum of sizes, 2) texture coordinates; NaN where a corner has none
    document: Any = None

    @cached_property
    def triangles(self):
        """(t, 3) int32 triangles of the polygons, in their order."""
        return triangulated(self.vertices, self.sizes, self.corners).astype(np.int32)

    @property
    def surface(self):
        """(vertices, triangles)."""
        return self.vertices, self.triangles

    def moved(self, vertices):
        """This mesh with other positions, and the triangles of these."""
        mesh = replace(self, vertices=vertices)
        mesh.triangles = self.triangles
        return mesh

    def polygons(self):
        """The polygons as lists of vertices."""
        flat, ends = self.corners.tolist(), np.cumsum(self.sizes).tolist()
        return [flat[end - size : end] for size, end in zip(self.sizes.tolist(), ends, strict=True)]

    def checked(self, vertex_place, polygon_place):
        """This mesh; InvalidInput for coordinates or indices that are none.

        `vertex_place(i)` and `polygon_place(i)` say where in the file a vertex and a polygon stand.
        """
        usable = (np.abs(self.vertices) <= MOST).all(axis=1)
        if not usable.all():
            first = int(np.flatnonzero(~usable)[0])
            raise InvalidInput(f"{vertex_place(first)} is NaN, infinite or beyond single precision")
        wrong = (self.corners < 0) | (self.corners >= len(self.vertices))
        if wrong.any():
            polygon = int(np.searchsorted(np.cumsum(self.sizes), np.flatnonzero(wrong)[0], side="right"))
            raise InvalidInput(
                f"{polygon_place(polygon)} names a vertex beyond the {len(self.vertices)} there are"
            )
        return self


def as_bytes(colours):
    """Colours between 0 and 1 as bytes."""
    return np.round(np.clip(np.nan_to_num(colours), 0, 1) * 255).astype(np.uint8)


def numbers(values):
    """Texts of float64 numbers with as few digits as tell them from all others."""
    return map(repr, values)
