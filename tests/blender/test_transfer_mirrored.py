# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfers where the scale of an object mirrors it: all comes as without."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.character import link

    from addon.blender import mesh_arrays
    from addon.field_modifier import motion

pytestmark = pytest.mark.in_blender

NEAR = 1e-4  # single precision, and what mirrored sums round otherwise
TURN = np.array([[0.0, -1.4, 0.0], [1.4, 0.0, 0.0], [0.0, 0.0, 1.4]])
SHIFT = [3.0, 0.0, 1.0]


def mirror(item):
    """The same in the world, by a scale that mirrors."""
    item.data.transform(Matrix.Diagonal((-1, 1, 1, 1)), shape_keys=True)
    item.data.flip_normals()
    item.scale.x = -1
    bpy.context.view_layer.update()


def shell_around(item):
    points = scenes.world_points(item)
    outside = points * (1 + 0.1 / np.linalg.norm(points, axis=1, keepdims=True))
    mesh = bpy.data.meshes.new("Shell")
    mesh.from_pydata(outside.tolist(), [], [list(face.vertices) for face in item.data.polygons])
    worn = link("Shell", mesh)
    entry = item.arapfields.carried.add()
    entry.item, entry.way = worn, "FOLLOW"
    return worn


def moved(item):
    """Lays it onto the target, as a wrap does."""
    rest = scenes.world_points(item)
    linear = np.array(item.matrix_world)[:3, :3]
    motion.bind(bpy.context, item)
    motion.write(item, motion.Motion((rest @ TURN.T + SHIFT - rest) @ linear))


def handed_on(mirrored):
    """Offsets of the key and points of the copied shell, in the world, and the painted places."""
    for one in list(bpy.data.objects):
        bpy.data.objects.remove(one)
    item, target = scenes.bar(), scenes.bar("Other")
    target.data.transform(Matrix(np.vstack([np.c_[TURN, SHIFT], [0, 0, 0, 1]]).tolist()))
    item.shape_key_add(name="Basis")
    tall = item.shape_key_add(name="Tall")
    tall.value = 0.0  # Blender 5.2 adds keys with 1
    for point in tall.data:
        point.co.z += 0.3 * point.co.x**2 + 0.1 * point.co.y
        point.co.x += 0.1
    paint = item.data.color_attributes.new("Paint", "FLOAT_COLOR", "CORNER")
    corners = mesh_arrays.positions(item.data)[mesh_arrays.corner_vertices(item.data)]
    values = np.c_[corners, np.ones(len(corners))].astype(np.float32)
    paint.data.foreach_set("color", values.ravel())
    worn = shell_around(item)
    for name, one in (("item", item), ("target", target), ("worn", worn)):
        if name in mirrored:
            mirror(one)
    item.arapfields.wrap.onto = target
    moved(item)
    moved(worn)
    bpy.context.view_layer.update()
    scenes.activate(item)
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    bpy.context.view_layer.update()
    (copied,) = target.children
    at_rest = scenes.world_points(target)
    target.data.shape_keys.key_blocks["Tall"].value = 1.0
    bpy.context.view_layer.update()
    painted = np.empty(4 * len(target.data.loops), np.float32)
    target.data.attributes["Paint"].data.foreach_get("color", painted)
    by_vertex = np.empty((len(at_rest), 3))
    by_vertex[mesh_arrays.corner_vertices(target.data)] = painted.reshape(-1, 4)[:, :3]
    return scenes.world_points(target) - at_rest, scenes.world_points(copied), by_vertex


@pytest.mark.parametrize("mirrored", ["item", "target", "worn", "item target worn"])
def test_keys_and_clothes_come_as_without_a_mirror(mirrored):
    plain = handed_on("")
    assert np.abs(plain[0]).max() > 0.3
    for one, other in zip(plain, handed_on(mirrored), strict=True):
        assert np.abs(one - other).max() < NEAR
