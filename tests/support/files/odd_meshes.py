# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files as other programs write them: each format's spellings of the same shapes, with what they hold.

Shape(vertices (n, 3), polygons) is the truth that a file was written from. Coordinates have six decimals at
most.
"""

from dataclasses import dataclass

import numpy as np

SURVEY = np.array([432150.25, 5210437.75, 310.5])  # metres east, north and up
ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "uint8": "u1", "int32": "i4", "float32": "f4",
}  # fmt: skip


@dataclass
class Shape:
    vertices: np.ndarray
    polygons: list


def bracket():
    """A prism of C profile: two concave octagons, eight quadrilaterals."""
    profile = [(0, 0), (3, 0), (3, 0.5), (0.5, 0.5), (0.5, 2.5), (3, 2.5), (3, 3), (0, 3)]
    n = len(profile)
    vertices = np.array([(x, y, z) for z in (0, 0.5) for x, y in profile], float)
    sides = [[i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n)]
    return Shape(vertices, [[*range(n - 1, -1, -1)], [*range(n, 2 * n)], *sides])


def ball(rings=5, segments=8):
    """A sphere of quadrilaterals, with triangles at its poles."""
    steep = np.linspace(0, np.pi, rings + 1)[1:-1]
    round_ = np.arange(segments) * 2 * np.pi / segments
    rows = [(np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)) for a in steep for b in round_]
    vertices = np.round(np.array([*rows, (0, 0, 1), (0, 0, -1)]), 6)

    def at(ring, place):
        return ring * segments + place % segments

    top, last = len(vertices) - 2, rings - 2
    around = range(segments)
    faces = [[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)] for i in range(last) for j in around]
    faces += [[top, at(0, j), at(0, j + 1)] for j in around]
    return Shape(vertices, faces + [[top + 1, at(last, j + 1), at(last, j)] for j in around])


def triangles():
    """A cube of twelve triangles, whose vertices are in the order of their first use."""
    corners = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float) * 0.625
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    _, first = np.unique(faces, return_index=True)
    order = np.argsort(first)
    return Shape(corners[order], np.argsort(order)[faces].tolist())


def number(value):
    return f"{value:.6f}".rstrip("0").rstrip(".")


# OBJ


def obj(shape, corner="{0}", tail=""):
    """Lines of an OBJ file; `corner` is formatted with the number of a vertex, `tail` with its index."""
    lines = [
        f"v {' '.join(map(number, row))}{tail.format(i, i / 100)}" for i, row in enumerate(shape.vertices)
    ]
    return lines + ["f " + " ".join(corner.format(i + 1) for i in face) for face in shape.polygons]


def relative(shape):
    """Each face behind vertices of its own kind, by numbers from the end."""
    lines, given = [], 0
    for face in shape.polygons:
        for row in shape.vertices[given : max(face) + 1]:
            lines.append("v " + " ".join(map(number, row)))
        given = max(given, max(face) + 1)
        lines.append("f " + " ".join(str(i - given) for i in face))
    return lines


def continued(lines):
    """Every statement over two lines."""
    return [line.replace(" ", " \\\n ", 2) if line[0] in "vf" else line for line in lines]


def scene(shape):
    """Objects, groups, smoothing, materials, lines and points among the faces."""
    rows = obj(shape)
    count = len(shape.vertices)
    between = ["o one", "g upper lower", "s 1", "usemtl red_paint", "s off", "usemtl blue", "g"]
    faces = rows[count:]
    mixed = [line for pair in zip(faces, between * len(faces), strict=False) for line in pair]
    return ["mtllib none.mtl", "o Thing", *rows[:count], "l 1 2 3", "p 1", *mixed, "l -1 -2"]


def exponents(line):
    return line.replace(" 0.5", " +5.0E-1").replace(" 3", " 300e-2") if line[0] == "v" else line


def text(lines, end="\n"):
    return (end.join(lines) + end).encode()


def obj_files():
    """{name: (bytes, Shape)}."""
    shape, count = bracket(), len(bracket().vertices)
    textures = [f"vt {i / 10} {1 - i / 10}" for i in range(count)]
    plain = obj(shape)
    loose = Shape(np.concatenate([shape.vertices, [[9, 9, 9]], shape.vertices[:1] + 5]), shape.polygons)
    far = Shape(ball().vertices + SURVEY, ball().polygons)
    return {
        "plain.obj": (text(plain), shape),
        "ball.obj": (text(obj(ball())), ball()),
        "tabs.obj": (text(plain).replace(b" ", b"\t"), shape),
        "spaces.obj": (
            text(plain).replace(b" ", b"   ").replace(b"f", b"  f").replace(b"\n", b"  \n\n"),
            shape,
        ),
        "windows.obj": (text(plain, "\r\n"), shape),
        "mark.obj": (b"\xef\xbb\xbf" + text(plain), shape),
        "comments.obj": (text(["# C ✓", *(f"{line} # and so on" for line in plain)]), shape),
        "continued.obj": (text(continued(plain)), shape),
        "continued_windows.obj": (text(continued(plain)).replace(b"\n", b"\r\n"), shape),
        "relative.obj": (text(relative(shape)), shape),
        "weights.obj": (text(obj(shape, tail=" 1.5")), shape),
        "colours.obj": (text(obj(shape, tail=" {1} 0.5 0.25")), shape),
        "texture.obj": (text([*textures, *obj(shape, "{0}/{0}")]), shape),
        "normals.obj": (text(["vn 0 0 1", *obj(shape, "{0}//1")]), shape),
        "all_of_a_corner.obj": (text(["vn 0 0 1", *textures, *obj(shape, "{0}/{0}/1")]), shape),
        "scene.obj": (text(scene(shape)), shape),
        "loose.obj": (text(obj(loose)), loose),
        "old_mac.obj": (text(plain, "\r"), shape),
        "mixed_ends.obj": (text(plain[:9], "\r\n") + text(plain[9:]), shape),
        "no_end.obj": (text(plain).rstrip(b"\n"), shape),
        "exponents.obj": (text([exponents(line) for line in plain]), shape),
        "far.obj": (text(obj(far)), far),
    }


# PLY


def ply(form, elements, remarks=(), end="\n"):
    """Bytes of a PLY file; elements: [(name, [(property's declaration, its values in all rows)])]."""
    head = ["ply", f"format {form} 1.0", *remarks]
    for name, properties in elements:
        head.append(f"element {name} {len(properties[0][1])}")
        head += [f"property {declared}" for declared, _ in properties]
    data = b""
    for _, properties in elements:
        for row in zip(*(values for _, values in properties), strict=True):
            cells = [_cell(form, one[0].split(), value) for one, value in zip(properties, row, strict=True)]
            data += (" ".join(cells) + end).encode() if form == "ascii" else b"".join(cells)
    return (end.join([*head, "end_header"]) + end).encode() + data


def _cell(form, declared, value):
    is_list = declared[0] == "list"
    if form == "ascii":
        return " ".join([str(len(value)), *map(number, value)] if is_list else [number(value)])
    order = ORDERS[form]
    if not is_list:
        return np.array(value, order + TYPES[declared[0]]).tobytes()
    head = np.array(len(value), order + TYPES[declared[1]])
    return head.tobytes() + np.array(value, order + TYPES[declared[2]]).tobytes()


def points(shape, kind="float"):
    return [(f"{kind} {axis}", shape.vertices[:, k]) for k, axis in enumerate("xyz")]


def faces(shape, declared="list uchar int vertex_indices"):
    return [(declared, shape.polygons)]


def ply_files():
    """{name: (bytes, Shape)}."""
    shape, count = ball(), len(ball().vertices)
    far = Shape(shape.vertices + SURVEY, shape.polygons)
    box = triangles()
    little, plain = "binary_little_endian", [("vertex", points(shape)), ("face", faces(shape))]
    shade = np.arange(count) % 256
    painted = points(shape) + [(f"uchar {name}", shade) for name in ("red", "green", "blue", "alpha")]
    rich = [
        ("float quality", shade / 7),
        *points(shape),
        ("short label", -shade),
        ("double confidence", shade / 3),
    ]
    normals = points(shape) + [(f"float n{axis}", shape.vertices[:, k]) for k, axis in enumerate("xyz")]
    edges = ("edge", [("int vertex1", [0, 1]), ("int vertex2", [1, 2]), ("uchar red", [3, 4])])
    wedges = [[k / 100 for k in range(2 * len(face))] for face in shape.polygons]
    marked = [*faces(shape), ("uchar flags", np.arange(len(shape.polygons)))]
    strip = Shape(
        np.array([(x, y, 0.125 * x) for x in range(4) for y in range(2)], float),
        [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 5, 6], [6, 5, 7]],
    )
    strips = ("tristrips", [("list int int vertex_indices", [[0, 1, 2, 3, 4, -1, 4, 5, 6, 7]])])
    remarks = ["comment made by hand: größer", "obj_info scanned"]
    found = {f"{form}.ply": (ply(form, plain), shape) for form in ORDERS}
    return found | {
        "concave.ply": (ply(little, [("vertex", points(bracket())), ("face", faces(bracket()))]), bracket()),
        "doubles.ply": (ply(little, [("vertex", points(far, "double")), ("face", faces(shape))]), far),
        "doubles_big.ply": (
            ply("binary_big_endian", [("vertex", points(far, "double")), ("face", faces(shape))]),
            far,
        ),
        "numbered_types.ply": (
            ply(
                little,
                [
                    ("vertex", points(shape, "float32")),
                    ("face", faces(shape, "list uint8 int32 vertex_index")),
                ],
            ),
            shape,
        ),
        "wide_counts.ply": (
            ply(little, [plain[0], ("face", faces(shape, "list int uint vertex_indices"))]),
            shape,
        ),
        "short_indices.ply": (
            ply("binary_big_endian", [plain[0], ("face", faces(shape, "list ushort ushort vertex_indices"))]),
            shape,
        ),
        "colours.ply": (ply(little, [("vertex", painted), plain[1]]), shape),
        "colours_text.ply": (ply("ascii", [("vertex", painted), plain[1]]), shape),
        "properties.ply": (ply(little, [("vertex", rich), ("face", marked)]), shape),
        "properties_text.ply": (ply("ascii", [("vertex", rich), ("face", marked)]), shape),
        "normals.ply": (ply(little, [("vertex", normals), plain[1]]), shape),
        "elements.ply": (ply(little, [plain[0], edges, plain[1]]), shape),
        "wedges.ply": (
            ply(little, [plain[0], ("face", [*faces(shape), ("list uchar float texcoord", wedges)])]),
            shape,
        ),
        "remarks.ply": (ply(little, plain, remarks), shape),
        "windows.ply": (ply("ascii", plain, end="\r\n"), shape),
        "trailing.ply": (ply(little, plain) + b"and more", shape),
        "triangles.ply": (ply(little, [("vertex", points(box)), ("face", faces(box))]), box),
        "faces_first.ply": (ply(little, plain[::-1]), shape),
        "faces_first_text.ply": (ply("ascii", plain[::-1]), shape),
        "old_mac.ply": (ply("ascii", plain, end="\r"), shape),
        "strips.ply": (ply(little, [("vertex", points(strip)), strips]), strip),
    }


# STL


def facets(shape):
    """Corners (t, 3, 3) of a shape of triangles."""
    return shape.vertices[np.array(shape.polygons)]


def binary_stl(shape, header=b"made by hand"):
    rows = np.zeros(len(shape.polygons), [("n", "<f4", 3), ("c", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["c"], rows["attribute"] = facets(shape), np.arange(len(rows))
    return header.ljust(80, b"\0") + len(rows).to_bytes(4, "little") + rows.tobytes()


def text_stl(shape, name="cube", indent="  "):
    lines = [f"solid {name}"]
    for corners in facets(shape):
        lines += [f"{indent}facet normal 0 0 0", f"{indent * 2}outer loop"]
        lines += [f"{indent * 3}vertex {' '.join(map(number, row))}" for row in corners]
        lines += [f"{indent * 2}endloop", f"{indent}endfacet"]
    return text([*lines, f"endsolid {name}"])


def stl_files():
    """{name: (bytes, Shape)}."""
    shape = triangles()
    first, second = (Shape(shape.vertices, shape.polygons[part]) for part in (slice(0, 6), slice(6, 12)))
    return {
        "plain.stl": (binary_stl(shape), shape),
        "solid.stl": (binary_stl(shape, b"solid made by hand"), shape),
        "trailing.stl": (binary_stl(shape) + b"and more", shape),
        "solid_trailing.stl": (binary_stl(shape, b"solid of another") + bytes(70), shape),
        "text.stl": (text_stl(shape), shape),
        "named_binary.stl": (text_stl(shape, "binary"), shape),
        "named_vertex.stl": (text_stl(shape, "vertex 1 2 3"), shape),
        "two_solids.stl": (text_stl(first, "one") + text_stl(second, "two"), shape),
        "capitals.stl": (text_stl(shape).upper(), shape),
        "mark.stl": (b"\xef\xbb\xbf" + text_stl(shape), shape),
        "windows.stl": (text_stl(shape, indent="\t").replace(b"\n", b"\r\n"), shape),
    }


# OFF


def off(shape, keyword="OFF", vertex="", face=""):
    """Lines of an OFF file; `vertex` and `face` follow each row, formatted with its number."""
    lines = [keyword, f"{len(shape.vertices)} {len(shape.polygons)} 0"]
    lines += [" ".join(map(number, row)) + vertex.format(i) for i, row in enumerate(shape.vertices)]
    return lines + [
        " ".join(map(str, (len(row), *row))) + face.format(i) for i, row in enumerate(shape.polygons)
    ]


def binary_off(shape):
    rows = [np.array([len(row), *row, 0], ">i4").tobytes() for row in shape.polygons]
    counts = np.array([len(shape.vertices), len(shape.polygons), 0], ">i4")
    return b"OFF BINARY\n" + counts.tobytes() + shape.vertices.astype(">f4").tobytes() + b"".join(rows)


def off_files():
    """{name: (bytes, Shape)}."""
    shape = bracket()
    lines = off(shape)
    return {
        "plain.off": (text(lines), shape),
        "one_line.off": (text([f"OFF {lines[1]}", *lines[2:]]), shape),
        "no_keyword.off": (text(lines[1:]), shape),
        "comments.off": (text(["# C", lines[0], "", *(f"{line} # so" for line in lines[1:])]), shape),
        "windows.off": (text(lines, "\r\n"), shape),
        "colours.off": (text(off(shape, "COFF", " {0} 128 64 255")), shape),
        "normals.off": (text(off(shape, "NOFF", " 0 0 1")), shape),
        "face_colours.off": (text(off(shape, face=" {0} 128 64")), shape),
        "all.off": (text(off(shape, "STCNOFF", " 0 0 1 0.25 0.5 1.0 1 0.5 0.5", " 7")), shape),
        "binary.off": (binary_off(shape), shape),
    }


def for_blender():
    """{name: (bytes, Shape)} of the formats that Blender reads."""
    return obj_files() | ply_files() | stl_files()


def all_files():
    return for_blender() | off_files()
