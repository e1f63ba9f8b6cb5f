# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh as its file has it: positions, polygons, their triangles."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ..._interrupts import uninterrupted
from ..._native import InvalidInput

# Polygons as triangles: fans where these lie inside the outline, else by ear clipping.

FLAT = 1e-12  # share of a polygon's area that a fan's triangle may lie outside, from rounding


def triangulated(vertices, sizes, corners):
    """Triangles (t, 3) of polygons in their order: size - 2 of each.

    `sizes` (m,) are the polygons' numbers of corners, `corners` their vertices one after the other. A polygon
    is a fan about its first corner if that covers it, as of all convex ones; a quadrilateral may also be one
    about its second corner. Polygons of fewer than three corners have no triangles.
    """
    starts, counts = np.cumsum(sizes) - sizes, np.maximum(sizes - 2, 0)
    firsts = np.cumsum(counts) - counts
    result = np.empty((int(counts.sum()), 3), np.int64)
    for size in np.unique(sizes[sizes >= 3]).tolist():
        these = np.flatnonzero(sizes == size)
        rows = corners[starts[these, None] + np.arange(size)]
        fan = np.stack([np.zeros(size - 2, int), np.arange(1, size - 1), np.arange(2, size)], axis=1)
        local = np.repeat(fan[None], len(these), axis=0)
        outside = ~_is_covered(vertices, rows)
        if size == 4:
            turned = np.flatnonzero(outside)
            turned = turned[_is_covered(vertices, np.roll(rows[turned], -1, axis=1))]
            local[turned], outside[turned] = (fan + 1) % 4, False
        for index in np.flatnonzero(outside):
            local[index] = _clipped(vertices[rows[index]], fan)
        places = firsts[these, None] + np.arange(size - 2)
        result[places] = rows[np.arange(len(these))[:, None, None], local]
    return result


def _is_covered(vertices, rows):
    """(m,) whether the fan about the first corner of each polygon (m, k) lies inside it."""
    if rows.shape[1] == 3:
        return np.ones(len(rows), bool)
    spokes = vertices[rows[:, 1:]] - vertices[rows[:, :1]]
    areas = np.cross(spokes[:, :-1], spokes[:, 1:])
    normals = areas.sum(axis=1)
    sides = np.einsum("mkc,mc->mk", areas, normals)
    return (sides >= -FLAT * np.einsum("mc,mc->m", normals, normals)[:, None]).all(axis=1)


def _clipped(outline, fan):
    """Triangles (k - 2, 3) of one outline (k, 3) in space; the fan if it has no inside."""
    shape = outline - outline[0]
    normal = np.cross(shape[1:-1], shape[2:]).sum(axis=0)
    flat = np.delete(shape, int(np.argmax(np.abs(normal))), axis=1)
    found = _earcut()(np.ascontiguousarray(flat, float), np.array([len(flat)], np.uint32))
    # Each triangle's corners follow each other as along the outline.
    triangles = np.sort(np.asarray(found, np.int64).reshape(-1, 3), axis=1)
    complete = _with_straight_corners(triangles.tolist(), len(outline))
    return np.array(complete) if len(complete) == len(fan) else fan


def _with_straight_corners(triangles, size):
    """Adds the corners that ear clipping leaves out, as they lie on straight lines of the outline."""
    if len(triangles) == size - 2:
        return triangles
    edges = {(t[k - 1], t[k]) for t in triangles for k in range(3)}
    straight = {(i, j) for i, j in edges if (i + 1) % size != j and (j, i) not in edges}
    complete, waiting = [], list(triangles)
    while waiting:
        triangle = waiting.pop()
        turns = [(triangle[k - 2], triangle[k - 1], triangle[k]) for k in range(3)]
        split = next(((i, j, k) for i, j, k in turns if (i, j) in straight), None)
        if split is None:
            complete.append(triangle)
            continue
        i, j, k = split
        line = [(i + step) % size for step in range((j - i) % size + 1)]
        waiting += [[a, b, k] for a, b in pairwise(line)]
    return complete


def _earcut():
    try:
        with uninterrupted():
            from mapbox_earcut import triangulate_float64
    except ImportError:
        raise ImportError(
            "concave polygons need the package mapbox-earcut: pip install 'arapfields[cli]'"
        ) from None
    return triangulate_float64


# The mesh of a file, whatever its format.

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
