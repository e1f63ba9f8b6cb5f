# SPDX-License-Identifier: GPL-3.0-or-later
"""STL, binary and text: triangles, whose equal corners become one vertex."""

import codecs

import numpy as np

from ..._native import InvalidInput
from .mesh import Mesh, numbers
from .obj import LINES

HEADER = 84  # bytes before the facets: a text, and their number
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read(path):
    """The Mesh of an STL file; its vertices are in the order of their first appearance."""
    data = path.read_bytes()
    count = int.from_bytes(data[80:HEADER], "little")
    there = max(len(data) - HEADER, 0) // FACET.itemsize
    if _is_text(data, len(data) == HEADER + count * FACET.itemsize):
        return _text(path, data)
    if len(data) < HEADER:
        raise InvalidInput(f"{path}: is cut off: a binary STL has {HEADER} bytes before its triangles")
    if count > there:
        raise InvalidInput(
            f"{path}: is cut off, or no STL: of the {count} triangles it tells of, {there} are there"
        )
    facets = np.frombuffer(data, FACET, count, HEADER)
    corners = facets["corners"].astype(float).reshape(-1, 3)
    return _mesh(corners, lambda kept: Binary(data, count, kept), lambda i: f"{path}: triangle {i}")


def _is_text(data, is_exact):
    """Whether this is text; the header of a binary file may begin with the same word."""
    start = data.removeprefix(codecs.BOM_UTF8)[:2048].lstrip().lower()
    return not is_exact and start.startswith(b"solid") and (b"facet" in start or b"endsolid" in start)


def _mesh(corners, document, place):
    """The Mesh of triangles' corners (3t, 3)."""
    by_place = np.lexsort(corners.T)
    rows = corners[by_place]
    is_new = np.ones(len(rows), bool)
    is_new[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    first = np.empty(len(rows), np.int64)  # the first corner at the same place
    first[by_place] = by_place[is_new][np.cumsum(is_new) - 1]
    firsts, kept = np.unique(first, return_inverse=True)
    sizes = np.full(len(corners) // 3, 3)
    mesh = Mesh(corners[firsts], sizes, kept, document=document(kept))
    return mesh.checked(lambda i: f"{place(firsts[i] // 3)}: a corner", place)


def _text(path, data):
    lines = LINES.findall(data.decode("utf-8-sig", "surrogateescape"))
    corners, places, facets, inside = [], [], 0, False
    for number, line in enumerate(lines, 1):
        words = line.split()
        keyword = words[0].lower() if words else ""
        if keyword == "vertex":
            try:
                corners += [float(words[1]), float(words[2]), float(words[3])]
            except (ValueError, IndexError):
                raise InvalidInput(f"{path}: line {number}: a vertex needs three coordinates") from None
            places.append(number)
        elif keyword == "facet":
            facets += 1
        elif keyword == "endfacet" and len(places) != 3 * facets:
            raise InvalidInput(f"{path}: line {number}: a facet does not have three corners")
        elif keyword in ("solid", "endsolid"):
            inside = keyword == "solid"
    if inside or len(places) != 3 * facets:
        raise InvalidInput(f"{path}: is cut off: the last solid has no end")
    corners = np.array(corners, float).reshape(-1, 3)
    return _mesh(corners, lambda kept: Text(lines, kept), lambda i: f"{path}: line {places[3 * i]}: a facet")


def normals_of(corners):
    """(t, 3) unit normals of triangles (t, 3, 3); zero where a triangle has no area."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)


class Binary:
    """A binary file: its header and attributes stay; what follows the triangles goes."""

    def __init__(self, data, count, corners):
        self._data, self._count, self._corners = data, count, corners

    def write(self, path, vertices):
        facets = np.frombuffer(self._data, FACET, self._count, HEADER).copy()
        corners = vertices[self._corners].reshape(-1, 3, 3)
        facets["corners"], facets["normal"] = corners, normals_of(corners)
        path.write_bytes(self._data[:HEADER] + facets.tobytes())
        return True


class Text:
    """A text file: its lines, with the solids' names."""

    def __init__(self, lines, corners):
        self._lines, self._corners = lines, corners

    def write(self, path, vertices):
        corners = vertices[self._corners]
        normals = iter(normals_of(corners.reshape(-1, 3, 3)).tolist())
        rows = iter(corners.tolist())
        with open(path, "w", encoding="utf-8", errors="surrogateescape", newline="") as file:
            for line in self._lines:
                words = line.split(None, 1)
                keyword = words[0].lower() if words else ""
                if keyword in ("vertex", "facet"):
                    row, word = (rows, "") if keyword == "vertex" else (normals, "normal ")
                    start = line[: line.lower().index(keyword) + len(keyword)]
                    end = line[len(line.rstrip("\r\n")) :]
                    line = f"{start} {word}{' '.join(numbers(next(row)))}{end}"
                file.write(line)
        return False


def write(path, mesh):
    """Writes the triangles of the mesh as a binary STL file."""
    corners = mesh.vertices[mesh.triangles]
    facets = np.zeros(len(corners), FACET)
    facets["corners"], facets["normal"] = corners, normals_of(corners)
    path.write_bytes(bytes(80) + len(facets).to_bytes(4, "little") + facets.tobytes())
    return True
