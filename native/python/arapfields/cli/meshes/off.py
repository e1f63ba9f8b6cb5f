# SPDX-License-Identifier: GPL-3.0-or-later
"""OFF, as text and as Geomview's binary: polygons, colours of vertices and faces."""

import re

import numpy as np

from ..._files import read_text
from ..._native import InvalidInput
from .mesh import Mesh, as_bytes, numbers
from .obj import LINES

HEADER = re.compile(r"\s*(ST)?(C)?(N)?(4)?(n)?OFF\b")
ROW = re.compile(r"(\s*)" + r"\S+\s+" * 2 + r"[^\s#]+(.*)", flags=re.S)
ROW_WITH_NORMAL = re.compile(r"(\s*)" + r"\S+\s+" * 5 + r"[^\s#]+(.*)", flags=re.S)


def read(path):
    """The Mesh of an OFF file."""
    data = path.read_bytes()
    start = re.match(rb"\s*(?:ST)?C?N?OFF[ \t]+BINARY[ \t]*\r?\n", data)
    if start:
        return _binary(path, data, start)
    return _Text(path, LINES.findall(read_text(path, "surrogateescape", newline=""))).mesh()


def _kind(path, letters):
    if letters[3] or letters[4]:
        raise InvalidInput(f"{path}: is an OFF file of another dimension; three coordinates are needed")
    return {"st": 2 if letters[0] else 0, "colour": bool(letters[1]), "normal": 3 if letters[2] else 0}


class _Text:
    """The lines of a text file that hold data, and their numbers."""

    def __init__(self, path, lines):
        self._path, self._lines = path, lines
        self._data = [number for number, line in enumerate(lines) if line.partition("#")[0].strip()]

    def _refuse(self, row, what):
        place = f"line {self._data[row] + 1}: " if row < len(self._data) else ""
        raise InvalidInput(f"{self._path}: {place}{what}")

    def _words(self, row):
        return self._lines[self._data[row]].partition("#")[0].split()

    def mesh(self):
        if not self._data:
            self._refuse(0, "is empty")
        header = HEADER.match(self._lines[self._data[0]])
        kind = _kind(self._path, header.groups() if header else (None,) * 5)
        row = 0  # of the counts, which may follow the keyword on its line
        words = self._words(0)[1 if header else 0 :]
        if header and not words:
            row = 1
            words = self._words(1) if len(self._data) > 1 else []
        try:
            vertices, faces = int(words[0]), int(words[1])
        except (ValueError, IndexError):
            self._refuse(row, "is no OFF file: numbers of vertices and faces are needed")
        first = row + 1
        if vertices < 0 or faces < 0 or first + vertices + faces > len(self._data):
            self._refuse(row, f"is cut off: {vertices} vertices and {faces} faces are told of")
        points, colours = self._vertices(range(first, first + vertices), kind)
        sizes, corners, painted = self._faces(range(first + vertices, first + vertices + faces))
        lines = [self._data[i] for i in range(first, first + vertices)]
        document = Document(self._lines, self._data[0], lines, kind["normal"])
        mesh = Mesh(points, sizes, corners, colours, painted, None, document)
        at_faces = first + vertices
        return mesh.checked(
            lambda i: f"{self._path}: line {lines[i] + 1}: vertex {i}",
            lambda i: f"{self._path}: line {self._data[at_faces + i] + 1}: a face",
        )

    def _vertices(self, rows, kind):
        points, colours = [], []
        for row in rows:
            words = self._words(row)
            try:
                points += [float(words[0]), float(words[1]), float(words[2])]
                if len(words) < 3 + kind["normal"]:
                    raise ValueError
                after = words[3 + kind["normal"] : len(words) - kind["st"]]
                if kind["colour"]:
                    colours.append(_colour(after))
            except (ValueError, IndexError):
                further = " and a normal" * (kind["normal"] > 0) + " and a colour" * kind["colour"]
                self._refuse(row, f"a vertex needs three coordinates{further}")
        return np.array(points, float).reshape(-1, 3), np.array(colours) if colours else None

    def _faces(self, rows):
        sizes, corners, colours = [], [], {}
        for row in rows:
            words = self._words(row)
            try:
                size = int(words[0])
                if not 0 <= size < len(words):
                    raise ValueError
                corners += map(int, words[1 : size + 1])
                if len(words) > size + 3:
                    colours[len(sizes)] = _colour(words[size + 1 :])
            except ValueError:
                self._refuse(row, "a face needs the number of its corners, and as many vertices")
            sizes.append(size)
        painted = None
        if colours:
            painted = np.ones((len(sizes), 4))
            painted[list(colours)] = list(colours.values())
        return np.array(sizes, np.int64), np.array(corners, np.int64), painted


def _colour(words):
    """RGBA between 0 and 1, from three or four numbers: whole ones are of 255."""
    words = words[:4]
    if len(words) < 3:
        raise ValueError
    values = np.array([float(word) for word in words])
    if all(word.isdigit() for word in words):
        values = values / 255.0
    return np.append(values, 1.0)[:4]


class Document:
    """The lines of a text file, and which of them are the header and vertices."""

    def __init__(self, lines, header, vertex_lines, normal):
        self._lines, self._header, self._vertex_lines, self._normal = lines, header, vertex_lines, normal

    def write(self, path, vertices):
        """Writes the file with other positions, without normals."""
        lines = list(self._lines)
        if self._normal:
            lines[self._header] = lines[self._header].replace("NOFF", "OFF", 1)
        shape = ROW_WITH_NORMAL if self._normal else ROW
        for number, row in zip(self._vertex_lines, vertices.tolist(), strict=True):
            start, rest = shape.fullmatch(lines[number]).groups()
            lines[number] = f"{start}{' '.join(numbers(row))}{rest}"
        with open(path, "w", encoding="utf-8", errors="surrogateescape", newline="") as file:
            file.writelines(lines)
        return False


def _binary(path, data, start):
    """A binary file: counts, positions and faces as big-endian numbers of four bytes."""
    kind = _kind(path, HEADER.match(start[0].decode()).groups())
    words = 3 + kind["normal"] + 4 * kind["colour"] + kind["st"]
    begin = start.end() + 12
    counts = np.frombuffer(data, ">i4", 3, start.end()) if len(data) >= begin else np.full(3, -1)
    vertices, faces = map(int, counts[:2])
    at = begin + 4 * words * max(vertices, 0)
    if vertices < 0 or faces < 0 or at + 8 * faces > len(data):
        raise InvalidInput(f"{path}: is cut off: {vertices} vertices and {faces} faces are told of")
    rows = np.frombuffer(data, ">f4", vertices * words, begin).reshape(vertices, words)
    whole = np.frombuffer(data, ">i4", (len(data) - at) // 4, at)
    sizes, corners, place = [], [], 0
    for face in range(faces):
        size = int(whole[place]) if place < len(whole) else -1
        after = place + 1 + size  # of the number of colour components
        if size < 0 or after >= len(whole) or not 0 <= whole[after] <= 4:
            raise InvalidInput(f"{path}: face {face} is cut off or damaged")
        sizes.append(size)
        corners.append(whole[place + 1 : after])
        place = after + 1 + int(whole[after])
    colours = rows[:, 3 + kind["normal"] :][:, :4].astype(float) if kind["colour"] else None
    flat = np.concatenate(corners).astype(np.int64) if corners else np.empty(0, np.int64)
    document = Binary(data, start, rows, kind["normal"])
    mesh = Mesh(rows[:, :3].astype(float), np.array(sizes, np.int64), flat, colours, None, None, document)
    return mesh.checked(lambda i: f"{path}: vertex {i}", lambda i: f"{path}: face {i}")


class Binary:
    """A binary file; what follows the vertices is kept."""

    def __init__(self, data, start, rows, normal):
        self._data, self._start, self._rows, self._normal = data, start, rows, normal

    def write(self, path, vertices):
        rows = np.concatenate([vertices, self._rows[:, 3 + self._normal :]], axis=1).astype(">f4")
        keyword = self._start[0].replace(b"NOFF", b"OFF", 1) if self._normal else self._start[0]
        begin = self._start.end()
        end = begin + 12 + self._rows.nbytes
        path.write_bytes(keyword + self._data[begin : begin + 12] + rows.tobytes() + self._data[end:])
        return True


def write(path, mesh):
    """Writes polygons, with colours of vertices and faces, as an OFF file."""
    rows = [" ".join(numbers(row)) for row in mesh.vertices.tolist()]
    if mesh.colours is not None:
        rows = [
            f"{row} {r} {g} {b} {a}"
            for row, (r, g, b, a) in zip(rows, as_bytes(mesh.colours).tolist(), strict=True)
        ]
    faces = [" ".join(map(str, (len(face), *face))) for face in mesh.polygons()]
    if mesh.face_colours is not None:
        painted = as_bytes(mesh.face_colours).tolist()
        faces = [f"{face} {r} {g} {b} {a}" for face, (r, g, b, a) in zip(faces, painted, strict=True)]
    keyword = "OFF" if mesh.colours is None else "COFF"
    with open(path, "w", encoding="ascii", newline="\n") as file:
        file.write(f"{keyword}\n{len(rows)} {len(faces)} 0\n")
        file.writelines(f"{row}\n" for row in (*rows, *faces))
    return False
