# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line's readers and writers of mesh files beside Blender's importers, file by file."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER
from support.files import odd_meshes

from arapfields.cli.meshes import formats

if IN_BLENDER:
    import bpy

pytestmark = pytest.mark.in_blender

FILES = sorted(odd_meshes.for_blender())
# Blender knows no line ends of old Macs, no capitals; words of a solid's name are a vertex to it.
UNREADABLE = {"old_mac.obj", "old_mac.ply", "capitals.stl", "named_vertex.stl"}
# A byte order mark hides the first vertex from it, bytes behind the triangles all of them.
MISREAD = UNREADABLE | {"mark.obj", "trailing.stl", "solid_trailing.stl"}
SINGLE = 2.0**-23  # Blender's coordinates have single precision


def imported(path):
    """(vertices (n, 3), polygons) of a file by Blender's importer, without conversion of axes."""
    bpy.ops.wm.read_homefile(use_empty=True)
    where = {"filepath": str(path), "forward_axis": "Y", "up_axis": "Z"}
    if path.suffix == ".obj":
        bpy.ops.wm.obj_import(**where, use_split_objects=False, use_split_groups=False)
    else:
        {".ply": bpy.ops.wm.ply_import, ".stl": bpy.ops.wm.stl_import}[path.suffix](**where)
    (item,) = (item for item in bpy.data.objects if item.type == "MESH")
    vertices = np.array([vertex.co for vertex in item.data.vertices], float)
    return vertices, [list(polygon.vertices) for polygon in item.data.polygons]


def bent(points):
    """Positions that no two vertices share."""
    middle = points.mean(axis=0)
    x, y, z = (points - middle).T
    return middle + np.stack([x + 0.25 * y * y, y - 0.5 * z, z + 0.125 * x * y], axis=1)


def for_blender(name, vertices, polygons):
    """What Blender makes of a mesh: of an OBJ without the vertices that no polygon has."""
    if name != "loose.obj":
        return vertices, polygons
    used = np.unique(np.concatenate(polygons))
    return vertices[used], [np.searchsorted(used, row).tolist() for row in polygons]


def assert_same(found, vertices, polygons):
    assert found[0].shape == vertices.shape
    assert np.abs(found[0] - vertices).max() <= SINGLE * np.abs(vertices).max()
    assert found[1] == polygons


@pytest.mark.parametrize("name", FILES)
def test_a_mesh_file_is_read_as_by_blender(name, tmp_path):
    content, shape = odd_meshes.for_blender()[name]
    path = tmp_path / name
    path.write_bytes(content)
    mesh = formats.read(path)
    assert_same((mesh.vertices, mesh.polygons()), shape.vertices, shape.polygons)
    if name not in MISREAD:
        assert_same(imported(path), *for_blender(name, mesh.vertices, mesh.polygons()))


@pytest.mark.parametrize("name", FILES)
def test_a_moved_mesh_file_has_other_positions_alone_to_blender(name, tmp_path):
    path, moved = tmp_path / name, tmp_path / f"moved_{name}"
    path.write_bytes(odd_meshes.for_blender()[name][0])
    mesh = formats.read(path)
    formats.write_moved(moved, path.suffix, mesh, bent(mesh.vertices))
    if name not in UNREADABLE:
        assert_same(imported(moved), *for_blender(name, bent(mesh.vertices), mesh.polygons()))
