# SPDX-License-Identifier: GPL-3.0-or-later
"""PLY, as text and binary: polygons, triangle strips and colours; all other elements are kept as they are."""

import re
import struct
from dataclasses import dataclass, field

import numpy as np

from ..._native import InvalidInput
from .mesh import Mesh, as_bytes

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
POSITION, NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
INDICES = ("vertex_indices", "vertex_index")
COLOURS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
TEXTURES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
WEDGES = "texcoord"  # of faces: two coordinates for each corner
LAST = {b"\n": rb"[ \t\r]*\n", b"\r\n": rb"[ \t]*\r?\n", b"\r": rb"[ \t]*\r"}  # end of the header's last line
LINES = rb"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+"
CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}  # of the module struct


@dataclass
class Property:
    """`type` and, of lists, `length` are NumPy's codes without byte order; `line` is that of the header."""

    name: str
    type: str
    length: str | None
    line: int


@dataclass
class Element:
    """A kind of rows.

    `values` has an array for each number, and (sizes, all values) for each list. `raw` are the rows of the
    file: bytes, or lines of text.
    """

    name: str
    count: int
    properties: list = field(default_factory=list)
    values: dict = field(default_factory=dict)
    raw: object = None

    @property
    def has_lists(self):
        return any(one.length for one in self.properties)

    def dtype(self, order):
        return np.dtype([(one.name, order + one.type) for one in self.properties])

    def columns(self, names):
        """(count, k) float64 of numbers with these names; None if one is missing."""
        found = [self.values.get(name) for name in names]
        if any(column is None or isinstance(column, tuple) for column in found):
            return None
        return np.stack([np.asarray(column, float) for column in found], axis=1)


def read(path):
    """The Mesh of a PLY file; without faces it has points alone."""
    file = _File(path, path.read_bytes())
    vertex = file.element("vertex")
    positions = vertex.columns(POSITION) if vertex else None
    if positions is None:
        raise InvalidInput(f"{path}: has no vertices with x, y and z")
    sizes, corners = _polygons(file)
    face = file.element("face")
    mesh = Mesh(
        positions,
        sizes,
        corners,
        _colours(vertex),
        _padded(_colours(face), len(sizes)) if face else None,
        _texture(vertex, face, sizes, corners),
        Document(file),
    )
    first = file.first_line("vertex"), file.first_line("face")
    return mesh.checked(
        lambda i: f"{path}: vertex {i}" + (f" (line {first[0][i]})" if first[0] else ""),
        lambda i: f"{path}: face {i}" + (f" (line {first[1][i]})" if first[1] and i < len(first[1]) else ""),
    )


def _polygons(file):
    """(sizes, corners) of the faces, then of the triangles of strips."""
    sizes, corners = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    face, strips = file.element("face"), file.element("tristrips")
    for element in (face, strips):
        if element is None or element.count == 0:
            continue
        lists = [element.values[name] for name in INDICES if isinstance(element.values.get(name), tuple)]
        if not lists:
            raise InvalidInput(f"{file.path}: element {element.name} has no list vertex_indices")
        found = lists[0][0], lists[0][1].astype(np.int64)
        if element is strips:
            found = _of_strips(*found)
        sizes.append(found[0])
        corners.append(found[1])
    return np.concatenate(sizes), np.concatenate(corners)


def _of_strips(sizes, values):
    """Triangles of strips: each vertex makes one with the two before it, and every other one is turned.

    -1 begins a new strip.
    """
    if len(values) < 3:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    ends = np.zeros(len(values), bool)  # where a strip begins
    ends[(np.cumsum(sizes) - sizes)[sizes > 0]] = True
    ends |= values == -1
    ends[1:] |= values[:-1] == -1
    at = np.arange(len(values))
    begin = np.maximum.accumulate(np.where(ends, at, 0))
    last = np.flatnonzero((at - begin >= 2) & (values != -1))
    triangles = np.stack([values[last - 2], values[last - 1], values[last]], axis=1)
    turned = (last - begin[last]) % 2 == 1
    triangles[turned] = triangles[turned][:, [1, 0, 2]]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]  # what only links parts of a strip
    return np.full(len(triangles), 3), triangles.reshape(-1)


def _colours(element):
    """(count, 4) RGBA between 0 and 1; None without colours."""
    types = {one.name: one.type for one in element.properties}
    for names in COLOURS:
        found = element.columns(names)
        if found is None:
            continue
        alpha = element.columns([names[0].replace("red", "alpha")])
        found = np.concatenate([found, np.full((len(found), 1), np.nan) if alpha is None else alpha], axis=1)
        for column, name in enumerate((*names, names[0].replace("red", "alpha"))):
            if types.get(name, "f4")[0] != "f":
                found[:, column] /= np.iinfo(types[name]).max
        return np.where(np.isnan(found), 1.0, found)
    return None


def _padded(colours, count):
    """Colours of the faces; white for the triangles of strips behind them."""
    return None if colours is None else np.concatenate([colours, np.ones((count - len(colours), 4))])


def _texture(vertex, face, sizes, corners):
    wedges = face.values.get(WEDGES) if face else None
    if isinstance(wedges, tuple) and len(wedges[0]) == len(sizes):
        texture, full = np.full((len(corners), 2), np.nan), wedges[0] == 2 * sizes
        if full.any():
            texture[np.repeat(full, sizes)] = wedges[1][np.repeat(full, wedges[0])].reshape(-1, 2)
            return texture
    for names in TEXTURES:
        found = vertex.columns(names)
        if found is not None:
            inside = (corners >= 0) & (corners < len(found))
            return np.where(inside[:, None], found[np.where(inside, corners, 0)], np.nan)
    return None


class _File:
    """The header and the rows of a file."""

    def __init__(self, path, data):
        self.path = path
        first = re.match(rb"ply[ \t]*(\r\n|\r|\n)", data)
        last = first and re.search(rb"[\r\n][ \t]*end_header" + LAST[first[1]], data[: 1 << 20])
        if not last:
            self._refuse("is no PLY file, or its header is cut off")
        self.header = re.findall(LINES, data[: last.end()])
        self.order, self.elements = None, []
        self._read_header([line.decode("latin-1") for line in self.header])
        names = [element.name for element in self.elements]
        if len(set(names)) < len(names):
            self._refuse("two elements of its header have one name")
        if self.order is None:
            self._read_text(data[last.end() :])
        else:
            self._read_binary(data, last.end())

    def _refuse(self, what):
        raise InvalidInput(f"{self.path}: {what}")

    def element(self, name):
        return next((element for element in self.elements if element.name == name), None)

    def _read_header(self, lines):
        format_ = None
        for number, line in enumerate(lines[1:], 2):
            words = line.split()
            keyword = words[0] if words else "comment"
            try:
                if keyword == "format":
                    format_, self.order = words[1], ORDERS[words[1]]
                elif keyword == "element":
                    self.elements.append(Element(words[1], int(words[2])))
                    if self.elements[-1].count < 0:
                        raise ValueError
                elif keyword == "property":
                    self._add_property(words, number)
                elif keyword not in ("comment", "obj_info", "end_header"):
                    raise ValueError
            except (ValueError, IndexError, KeyError):
                shown = " ".join(words)[:60]
                self._refuse(f"line {number}: '{shown}' is no line of a PLY file's header")
        if format_ is None:
            self._refuse("its header names no format")

    def _add_property(self, words, number):
        length = TYPES[words[2]] if words[1] == "list" else None
        kind, name = (words[3], words[4]) if length else (words[1], words[2])
        known = [one.name for one in self.elements[-1].properties]
        if name in known or (length and length[0] == "f"):
            raise ValueError
        self.elements[-1].properties.append(Property(name, TYPES[kind], length, number - 1))

    def first_line(self, name):
        """The numbers of an element's lines of text; None in binary files."""
        element = self.element(name)
        return element.raw[0] if self.order is None and element and element.raw else None

    # Binary

    def _read_binary(self, data, place):
        for element in self.elements:
            least = sum(int((one.length or one.type)[1]) for one in element.properties)
            if least == 0 or element.count == 0:
                element.raw = b""
                continue
            there = (len(data) - place) // least
            if element.count > there:
                self._refuse(
                    f"is cut off: of {element.count} rows of {element.name}, {there} at most are there"
                )
            begin = place
            if element.has_lists:
                place = self._equal_lists(element, data, place) or self._lists(element, data, place)
            else:
                rows = np.frombuffer(data, element.dtype(self.order), element.count, place)
                element.values = {name: rows[name] for name in rows.dtype.names}
                place += rows.nbytes
            element.raw = data[begin:place]
        self.tail = data[place:]

    def _equal_lists(self, element, data, place):
        """Reads rows whose lists are all as long as those of the first; None if they are not."""
        first = self._cells(element, data, place)
        if first is None:
            return None
        fields = []
        for one, cell in zip(element.properties, first, strict=True):
            if one.length:
                size = (len(cell) - int(one.length[1])) // int(one.type[1])
                fields += [
                    (f"{one.name} size", self.order + one.length),
                    (one.name, self.order + one.type, (size,)),
                ]
            else:
                fields.append((one.name, self.order + one.type))
        rows_type = np.dtype(fields)
        if element.count * rows_type.itemsize > len(data) - place:
            return None
        rows = np.frombuffer(data, rows_type, element.count, place)
        values = {}
        for one in element.properties:
            values[one.name] = rows[one.name]
            if one.length:
                sizes = rows[f"{one.name} size"].astype(np.int64)
                if (sizes != rows[one.name].shape[1]).any():
                    return None
                values[one.name] = sizes, np.ascontiguousarray(rows[one.name]).reshape(-1)
        element.values = values
        return place + rows.nbytes

    def _cells(self, element, data, place):
        """The bytes of each property of the row at `place`; None if the row is not whole."""
        cells = []
        for one in element.properties:
            width = int(one.type[1])
            if one.length:
                head = int(one.length[1])
                counted = data[place : place + head]
                size = int.from_bytes(
                    counted, "little" if self.order == "<" else "big", signed=one.length[0] == "i"
                )
                if len(counted) < head or size < 0:
                    return None
                width = head + width * size
            cell = data[place : place + width]
            if len(cell) < width:
                return None
            cells.append(cell)
            place += width
        return cells

    def _lists(self, element, data, place):
        """Reads rows with lists of several lengths; returns the place after them."""
        runs = [([], [], None)]  # of numbers, each up to a list: (properties, places in all rows, the list)
        for one in element.properties:
            if one.length:
                runs[-1] = (*runs[-1][:2], (one, [], []))
                runs.append(([], [], None))
            else:
                runs[-1][0].append(one)
        steps = []
        for numbers, places, lists in runs:
            width = sum(int(one.type[1]) for one in numbers)
            if lists:
                one, starts, sizes = lists
                read_size = struct.Struct(self.order + CODES[one.length]).unpack_from
                steps.append((width, places, read_size, int(one.length[1]), int(one.type[1]), starts, sizes))
        after, last = width, places
        for row in range(element.count):
            try:
                for width, places, read_size, head, item, starts, sizes in steps:
                    if width:
                        places.append(place)
                        place += width
                    size = read_size(data, place)[0]
                    place += head
                    starts.append(place)
                    sizes.append(size)
                    if size < 0:
                        raise struct.error
                    place += size * item
            except struct.error:
                place = len(data) + 1
            last.append(place)
            place += after
            if place > len(data):
                self._refuse(f"is cut off or damaged at row {row} of {element.name}")
        for numbers, places, lists in runs:
            at = np.array(places, np.int64)
            for one in numbers:
                element.values[one.name] = self._gathered(data, at, one.type)
                at = at + int(one.type[1])
            if lists:
                one, starts, sizes = lists
                sizes, item = np.array(sizes, np.int64), int(one.type[1])
                first = np.array(starts, np.int64) - item * (np.cumsum(sizes) - sizes)
                at = np.repeat(first, sizes) + item * np.arange(sizes.sum())
                element.values[one.name] = sizes, self._gathered(data, at, one.type)
        return place

    def _gathered(self, data, places, kind):
        """The numbers of a type at these places."""
        found = np.frombuffer(data, np.uint8)[places[:, None] + np.arange(int(kind[1]))]
        return found.reshape(-1).view(self.order + kind)

    # Text

    def _read_text(self, data):
        lines = re.findall(LINES.decode(), data.decode("latin-1"))
        before = len(self.header)
        filled = [number for number, line in enumerate(lines) if line.strip()]
        place = 0
        for element in self.elements:
            if not element.properties:
                continue
            mine = filled[place : place + element.count]
            if len(mine) < element.count:
                self._refuse(f"is cut off: of {element.count} rows of {element.name}, {len(mine)} are there")
            place += element.count
            rows = [lines[number] for number in mine]
            element.raw = [number + before + 1 for number in mine], rows
            if element.name in ("vertex", "face", "tristrips"):
                self._take_rows(element)
        self.tail = "".join(lines[filled[place - 1] + 1 :] if place else lines).encode("latin-1")

    def _take_rows(self, element):
        columns = {one.name: ([], []) if one.length else [] for one in element.properties}
        steps = [
            (columns[one.name], one.length, int if one.type[0] in "iu" else float)
            for one in element.properties
        ]
        for number, line in zip(*element.raw, strict=True):
            words, place = line.split(), 0
            try:
                for column, length, convert in steps:
                    if length:
                        size = int(words[place])
                        found = [convert(word) for word in words[place + 1 : place + 1 + size]]
                        if size < 0 or len(found) < size:
                            raise ValueError
                        column[0].append(size)
                        column[1].extend(found)
                        place += size
                    else:
                        column.append(convert(words[place]))
                    place += 1
            except (ValueError, IndexError):
                shown = line.strip()[:60]
                self._refuse(f"line {number}: '{shown}' is no row of {element.name}, or is cut off")
        for one in element.properties:
            found, kind = columns[one.name], np.int64 if one.type[0] in "iu" else float
            try:
                lists = (np.array(found[0], np.int64), np.array(found[1], kind)) if one.length else None
                element.values[one.name] = lists or np.array(found, kind)
            except OverflowError:
                self._refuse(f"{one.name} of a {element.name} is no {one.type} number")


class Document:
    """A file's header and rows."""

    def __init__(self, file):
        self._file = file

    def write(self, path, vertices):
        """Writes the file with other positions; whole numbers become doubles, and normals go."""
        file, vertex = self._file, self._file.element("vertex")
        kinds = {one.name: one.type for one in vertex.properties}
        stored = {name: kinds[name] if kinds[name][0] == "f" else "f8" for name in POSITION}
        dropped = NORMAL if all(name in kinds for name in NORMAL) else ()
        with open(path, "wb") as output:
            output.write(self._header(vertex, stored, dropped))
            for element in file.elements:
                if not element.properties:
                    continue
                if element is not vertex:
                    raw = element.raw
                    output.write(raw if file.order else "".join(raw[1]).encode("latin-1"))
                elif file.order and not element.has_lists:
                    output.write(self._rows(element, vertices, stored, dropped))
                else:
                    output.writelines(self._single_rows(element, vertices, stored, dropped))
            output.write(file.tail)
        return "f4" in stored.values() and file.order is not None

    def _header(self, vertex, stored, dropped):
        lines = list(self._file.header)
        for one in vertex.properties:
            if one.name in dropped:
                lines[one.line] = b""
            elif stored.get(one.name, one.type) != one.type:
                lines[one.line] = re.sub(rb"property(\s+)\S+", rb"property\1double", lines[one.line], count=1)
        return b"".join(lines)

    def _rows(self, vertex, vertices, stored, dropped):
        order = self._file.order
        kept = [one for one in vertex.properties if one.name not in dropped]
        rows = np.empty(vertex.count, [(one.name, order + stored.get(one.name, one.type)) for one in kept])
        for one in kept:
            rows[one.name] = vertex.values[one.name]
        for axis, name in enumerate(POSITION):
            rows[name] = vertices[:, axis]
        return rows.tobytes()

    def _single_rows(self, vertex, vertices, stored, dropped):
        """The vertices one after the other: bytes with lists among them, or lines of text."""
        file, place = self._file, 0
        for index, row in enumerate(vertices.tolist()):
            moved = dict(zip(POSITION, row, strict=True))
            if file.order is None:
                line = vertex.raw[1][index]
                cells, end = _text_cells(vertex, line), line[len(line.rstrip()) :]
                texts = {name: repr(value) for name, value in moved.items()}
            else:
                cells = file._cells(vertex, vertex.raw, place)
                place += sum(map(len, cells))
                texts = {
                    name: np.array(value, file.order + stored[name]).tobytes()
                    for name, value in moved.items()
                }
            kept = [
                texts.get(one.name, cell)
                for one, cell in zip(vertex.properties, cells, strict=True)
                if one.name not in dropped
            ]
            yield b"".join(kept) if file.order else (" ".join(kept) + end).encode("latin-1")


def _text_cells(element, line):
    """The words of each property of a line; of lists with their length."""
    words, cells, place = line.split(), [], 0
    for one in element.properties:
        size = 1 + int(words[place]) if one.length else 1
        cells.append(" ".join(words[place : place + size]))
        place += size
    return cells


def write(path, mesh):
    """Writes polygons with doubles for positions, colours and texture coordinates as a binary PLY file."""
    fields = [(name, "<f8") for name in POSITION]
    columns = [*mesh.vertices.T]
    if mesh.colours is not None:
        fields += [(name, "u1") for name in (*COLOURS[0], "alpha")]
        columns += [*as_bytes(mesh.colours).T]
    wedges = None
    if mesh.texture is not None:
        shared = _of_vertices(mesh)
        if shared is None:
            wedges = np.where(np.isnan(mesh.texture), 0.0, mesh.texture).astype("<f4")
        else:
            fields += [(name, "<f4") for name in TEXTURES[0]]
            columns += [*shared.T]
    rows = np.empty(len(mesh.vertices), fields)
    for (name, _), column in zip(fields, columns, strict=True):
        rows[name] = column
    length = "B" if mesh.sizes.max(initial=0) < 128 else "I"  # texture coordinates are two for each corner
    count = {"B": "uchar", "I": "uint"}[length]
    names = {"<f8": "double", "<f4": "float", "u1": "uchar"}
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n"
    header += "".join(f"property {names[kind]} {name}\n" for name, kind in fields)
    header += f"element face {len(mesh.sizes)}\nproperty list {count} int {INDICES[0]}\n"
    if wedges is not None:
        header += f"property list {count} float {WEDGES}\n"
    painted = None if mesh.face_colours is None else as_bytes(mesh.face_colours)
    if painted is not None:
        header += "".join(f"property uchar {name}\n" for name in (*COLOURS[0], "alpha"))
    with open(path, "wb") as file:
        file.write(f"{header}end_header\n".encode("ascii"))
        file.write(rows.tobytes())
        file.writelines(_faces(mesh, length, wedges, painted))
    return False


def _of_vertices(mesh):
    """(n, 2) texture coordinates of vertices; None if corners of one vertex differ."""
    shared = np.zeros((len(mesh.vertices), 2))
    shared[mesh.corners] = mesh.texture
    return shared if np.array_equal(shared[mesh.corners], mesh.texture) else None


def _faces(mesh, length, wedges, painted):
    """The rows of the faces."""
    ends = np.cumsum(mesh.sizes).tolist()
    corners = mesh.corners.astype("<i4")
    if wedges is None and painted is None and len(ends) and (mesh.sizes == mesh.sizes[0]).all():
        size = int(mesh.sizes[0])
        rows = np.empty(len(ends), [("size", "<" + length), ("corners", "<i4", (size,))])
        rows["size"], rows["corners"] = size, corners.reshape(-1, size)
        yield rows.tobytes()
        return
    head = struct.Struct("<" + length).pack
    for face, (size, end) in enumerate(zip(mesh.sizes.tolist(), ends, strict=True)):
        row = head(size) + corners[end - size : end].tobytes()
        if wedges is not None:
            row += head(2 * size) + wedges[end - size : end].tobytes()
        yield row if painted is None else row + painted[face].tobytes()
