# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks that exported mesh files are complete: Blender's exporters report no full disk. Without bpy."""

import struct

STL_HEADER, STL_TRIANGLE = 84, 50  # bytes
PLY_SIZES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}


def is_whole(path, meshes):
    """Whether the file contains all of these meshes, (vertices, polygons, loops) each."""
    polygons = sum(len(mesh.polygons) for mesh in meshes)
    corners = sum(len(mesh.loops) for mesh in meshes)
    try:
        if path.suffix.lower() == ".stl":
            return _stl(path, corners - 2 * polygons)
        if path.suffix.lower() == ".ply":
            return _ply(path, polygons, corners)
        return _obj(path, sum(len(mesh.vertices) for mesh in meshes), polygons)
    except (ValueError, KeyError, IndexError, struct.error):
        return False


def _stl(path, triangles):
    with path.open("rb") as file:
        (count,) = struct.unpack("<I", file.read(STL_HEADER)[80:])
    return count == triangles and path.stat().st_size == STL_HEADER + STL_TRIANGLE * count


def _ply(path, polygons, corners):
    """Little-endian PLY of Blender: vertices and edges have a fixed size, faces are lists."""
    size, counts, lists = 0, {}, {}
    with path.open("rb") as file:
        for line in iter(file.readline, b""):
            words = line.decode("latin-1").split()
            if words[:1] == ["element"]:
                element, counts[words[1]] = words[1], int(words[2])
            elif words[:2] == ["property", "list"]:
                lists[element] = PLY_SIZES[words[2]], PLY_SIZES[words[3]]
            elif words[:1] == ["property"]:
                size += counts[element] * PLY_SIZES[words[1]]
            elif words == ["end_header"]:
                break
        size += file.tell()
    if polygons:
        length, item = lists["face"]
        size += polygons * length + corners * item
    return counts.get("face", 0) == polygons and path.stat().st_size == size


def _obj(path, vertices, polygons):
    counts = {b"v": 0, b"f": 0}
    used, last = set(), b""
    with path.open("rb") as file:
        for last in file:
            word, _, rest = last.partition(b" ")
            if word in counts:
                counts[word] += 1
            elif word == b"usemtl":
                used.add(rest.strip())
    materials = path.with_suffix(".mtl")
    if materials.exists():
        text = materials.read_bytes()
        defined = {line[7:].strip() for line in text.splitlines() if line.startswith(b"newmtl ")}
        if not text.endswith(b"\n") or not used <= defined:
            return False
    return last.endswith(b"\n") and counts == {b"v": vertices, b"f": polygons}
