# SPDX-License-Identifier: GPL-3.0-or-later
"""Wavefront OBJ: polygons, texture coordinates, colours of vertices; other statements are kept as text."""

import re

import numpy as np

from ..._files import read_text
from ..._native import InvalidInput
from .mesh import Mesh, numbers

LINES = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")  # with their ends
VERTEX = re.compile(r"(\s*v\s+)\S+\s+\S+\s+[^\s#]+(.*)", flags=re.S)
CORNER = re.compile(r"(-?\d+)/(-?\d*)/-?\d*")
ZBRUSH = "#MRGB"  # a comment with colours of vertices, eight hexadecimal digits each: mask, red, green, blue
NEEDED = {
    "v": "three coordinates are needed",
    "vt": "numbers are needed",
    "f": "numbers of vertices are needed, from 1 on or from -1 back",
    "fo": "numbers of vertices are needed, from 1 on or from -1 back",
}


def read(path):
    """The Mesh of an OBJ file, with its vertices, also unused ones, in the file's order."""
    lines = LINES.findall(read_text(path, "surrogateescape", newline=""))
    found = _Found()
    for first, _, text in _statements(lines):
        words = text.split()
        take = found.by_keyword.get(words[0]) if words else None
        if take is None:
            continue
        if "#" in text:
            words = text.partition("#")[0].split() or words
        try:
            if "_" in text and "_" in "".join(words):
                raise ValueError  # 1_000 is a number to Python alone
            take(words, first + 1)
        except (ValueError, IndexError):
            shown = " ".join(words)[:60].encode("utf-8", "replace").decode()
            needed = NEEDED[words[0]]
            raise InvalidInput(f"{path}: line {first + 1}: '{shown}' cannot be read; {needed}") from None
    return found.mesh(path, Document(lines))


class _Found:
    """What the statements of a file define."""

    def __init__(self):
        self.vertices, self.vertex_lines = [], []
        self.colours, self.zbrush = {}, []
        self.coordinates = []
        self.sizes, self.corners, self.textures, self.face_lines = [], [], [], []
        self.by_keyword = {
            "v": self.take_vertex,
            "vt": self.take_coordinates,
            "f": self.take_face,
            "fo": self.take_face,  # of old files
            ZBRUSH: self.take_zbrush,
        }

    def take_vertex(self, words, line):
        x, y, z = float(words[1]), float(words[2]), float(words[3])
        if len(words) in (7, 8):  # with a colour; a single fourth number is a weight of rational curves
            self.colours[len(self.vertex_lines)] = [float(word) for word in words[4:7]]
        self.vertices += (x, y, z)
        self.vertex_lines.append(line)

    def take_coordinates(self, words, line):
        u = float(words[1])
        self.coordinates.append((u, float(words[2]) if len(words) > 2 else 0.0))

    def take_face(self, words, line):
        vertices, textures, words = len(self.vertex_lines), len(self.coordinates), words[1:]
        if not words:
            raise ValueError
        if "/" not in "".join(words):
            indices, found = map(int, words), [-1] * len(words)
        else:
            parts = [word.split("/") for word in words]
            indices = [int(part[0]) for part in parts]
            found = [int(part[1]) if len(part) > 1 and part[1] else 0 for part in parts]
            found = [index + textures if index < 0 else index - 1 for index in found]
            for part in parts:
                if len(part) > 2 and (part[2] or part[3:]):
                    int("/".join(part[2:]))  # the normal's number
        self.corners += [index + vertices if index < 0 else index - 1 for index in indices]
        self.textures += found
        self.sizes.append(len(words))
        self.face_lines.append(line)

    def take_zbrush(self, words, line):
        for block in re.findall("[0-9a-fA-F]{8}", "".join(words[1:])):  # it is a comment, whatever it holds
            self.zbrush.append(int(block, 16))

    def mesh(self, path, document):
        vertices = np.array(self.vertices, float).reshape(-1, 3)
        sizes, corners = np.array(self.sizes, np.int64), np.array(self.corners, np.int64)
        mesh = Mesh(vertices, sizes, corners, self._colours(), None, self._texture(), document)
        return mesh.checked(
            lambda i: f"{path}: line {self.vertex_lines[i]}: vertex {i}",
            lambda i: f"{path}: line {self.face_lines[i]}: a face",
        )

    def _colours(self):
        count = len(self.vertex_lines)
        if self.zbrush and len(self.zbrush) >= count and not self.colours:
            packed = np.array(self.zbrush[:count], np.uint64)[:, None] >> np.array([16, 8, 0], np.uint64)
            return np.column_stack([(packed & np.uint64(255)) / 255.0, np.ones(count)])
        if not self.colours:
            return None
        colours = np.ones((count, 4))
        colours[list(self.colours), :3] = list(self.colours.values())
        return colours

    def _texture(self):
        if not self.coordinates or not self.textures:
            return None
        known, wanted = np.array(self.coordinates), np.array(self.textures)
        there = (wanted >= 0) & (wanted < len(known))
        texture = np.full((len(wanted), 2), np.nan)
        texture[there] = known[wanted[there]]
        return texture if there.any() else None


def _statements(lines):
    """(first line, line after, text) of each statement; lines that end with a backslash go on in the next."""
    index = 0
    while index < len(lines):
        first, text = index, lines[index].rstrip("\r\n")
        index += 1
        while text.endswith("\\") and index < len(lines):
            text = text[:-1] + " " + lines[index].rstrip("\r\n")
            index += 1
        yield first, index, text


class Document:
    """The lines of an OBJ file."""

    def __init__(self, lines):
        self._lines = lines

    def write(self, path, vertices):
        """Writes the file with other positions, without normals: they are those of the old shape."""
        rows = iter(vertices.tolist())
        with open(path, "w", encoding="utf-8", errors="surrogateescape", newline="") as file:
            for first, after, text in _statements(self._lines):
                keyword = text.split(None, 1)[:1]
                if keyword == ["vn"]:
                    continue
                if keyword == ["v"]:
                    start, rest = VERTEX.fullmatch(text).groups()
                    text = f"{start}{' '.join(numbers(next(rows)))}{rest}"
                elif keyword in (["f"], ["fo"]) and "/" in text:
                    face, mark, comment = text.partition("#")
                    text = CORNER.sub(_without_normal, face) + mark + comment
                else:
                    file.writelines(self._lines[first:after])
                    continue
                ended = self._lines[after - 1]
                file.write(text + ended[len(ended.rstrip("\r\n")) :])
        return False


def _without_normal(corner):
    return f"{corner[1]}/{corner[2]}".rstrip("/")


def write(path, mesh):
    """Writes polygons, texture coordinates and colours of vertices as an OBJ file."""
    rows = mesh.vertices.tolist()
    if mesh.colours is not None:
        rows = [row + colour for row, colour in zip(rows, mesh.colours[:, :3].round(6).tolist(), strict=True)]
    with open(path, "w", encoding="ascii", newline="\n") as file:
        file.writelines(f"v {' '.join(numbers(row))}\n" for row in rows)
        corners = (mesh.corners + 1).astype(str).tolist()
        if mesh.texture is not None:
            has = np.isfinite(mesh.texture).all(axis=1)
            distinct, which = np.unique(mesh.texture[has], axis=0, return_inverse=True)
            file.writelines(f"vt {' '.join(numbers(row))}\n" for row in distinct.tolist())
            for corner, index in zip(np.flatnonzero(has).tolist(), which.reshape(-1).tolist(), strict=True):
                corners[corner] += f"/{index + 1}"
        ends = np.cumsum(mesh.sizes).tolist()
        for size, end in zip(mesh.sizes.tolist(), ends, strict=True):
            if size > 2:  # OBJ has no other faces
                file.write(f"f {' '.join(corners[end - size : end])}\n")
    return False
