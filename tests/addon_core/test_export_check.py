# SPDX-License-Identifier: GPL-3.0-or-later
"""Exported mesh files that are whole, and all their beginnings, which are not."""

import struct
from types import SimpleNamespace

import pytest

from addon.core.file_checks import are_whole_meshes

CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 1, 2, 3), (0, 1, 4), (1, 2, 4)]
MESH = SimpleNamespace(vertices=CORNERS, polygons=FACES, loops=[i for face in FACES for i in face])


def ply():
    head = "ply\nformat binary_little_endian 1.0\ncomment Created in Blender\nelement vertex 5\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += "element face 3\nproperty list uchar uint vertex_indices\nend_header\n"
    body = b"".join(struct.pack("<3f", *corner) for corner in CORNERS)
    return head.encode() + body + b"".join(struct.pack(f"<B{len(f)}I", len(f), *f) for f in FACES)


def stl():
    return b" " * 80 + struct.pack("<I", 4) + bytes(4 * 50)


def obj():
    lines = ["mtllib x.mtl", "o x", *("v {} {} {}".format(*c) for c in CORNERS), "vn 0 0 1", "usemtl skin"]
    return "\n".join([*lines, *("f " + " ".join(str(i + 1) for i in f) for f in FACES), ""]).encode()


@pytest.mark.parametrize("name", ["ply", "stl", "obj"])
def test_truncated_files_are_incomplete(name, tmp_path):
    content, path = {"ply": ply, "stl": stl, "obj": obj}[name](), tmp_path / f"x.{name}"
    path.write_bytes(content)
    assert are_whole_meshes(path, [MESH])
    for length in range(len(content)):
        path.write_bytes(content[:length])
        assert not are_whole_meshes(path, [MESH]), length
    path.write_bytes(content)
    assert not are_whole_meshes(path, [MESH, MESH])


def test_materials_belong_to_an_obj(tmp_path):
    path, materials = tmp_path / "x.obj", tmp_path / "x.mtl"
    path.write_bytes(obj())
    materials.write_text("newmtl skin\nKd 1 1 1\n")
    assert are_whole_meshes(path, [MESH])
    for text in ("newmtl skin\nKd 1", "newmtl other\n", ""):
        materials.write_text(text)
        assert not are_whole_meshes(path, [MESH])
