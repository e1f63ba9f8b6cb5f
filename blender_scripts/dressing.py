# SPDX-License-Identifier: GPL-3.0-or-later
"""Rig, weights and hair of characters. Bones are {name: (parent, head, tail)}."""

import bpy
import numpy as np


def link(name, data):
    item = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(item)
    return item


def rig(bones, name="Rig"):
    item = link(name, bpy.data.armatures.new(name))
    bpy.context.view_layer.objects.active = item
    bpy.ops.object.mode_set(mode="EDIT")
    for bone_name, (parent, head, tail) in bones.items():
        bone = item.data.edit_bones.new(bone_name)
        bone.head, bone.tail = head, tail
        if parent:
            bone.parent = item.data.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in item.pose.bones:
        bone.rotation_mode = "XYZ"
    return item


def weigh(item, bones, blend=0.04):
    """Adds vertex groups of the bones, blended where two are about equally near."""
    points = np.array([vertex.co for vertex in item.data.vertices])
    away = []
    for _, head, tail in bones.values():
        head, way = np.array(head), np.array(tail) - head
        share = np.clip((points - head) @ way / (way @ way), 0, 1)
        away.append(np.linalg.norm(points - head - share[:, None] * way, axis=1))
    weights = np.exp(-((np.array(away) - np.min(away, axis=0)) / blend))
    weights /= weights.sum(axis=0)
    for name, row in zip(bones, weights, strict=True):
        group = item.vertex_groups.new(name=name)
        for index in np.flatnonzero(row > 0.02).tolist():
            group.add([index], float(row[index]), "REPLACE")


def seen_mesh(item):
    """((n, 3) evaluated vertices in world space, their normals, triangles) of an object."""
    bpy.context.view_layer.update()
    seen = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh, world = seen.to_mesh(), np.array(seen.matrix_world)
    mesh.calc_loop_triangles()
    points = np.array([vertex.co for vertex in mesh.vertices]) @ world[:3, :3].T + world[:3, 3]
    normals = np.array([vertex.normal for vertex in mesh.vertices]) @ world[:3, :3].T
    triangles = np.array([triangle.vertices for triangle in mesh.loop_triangles])
    seen.to_mesh_clear()
    return points, normals, triangles


def strands(body, chosen, every=7, length=0.12, droop=3.0, steps=6, radius=None):
    """Hair curves from every `every`-th of the triangles whose centers (n, 3) are chosen."""
    points, normals, triangles = seen_mesh(body)
    middles, out = points[triangles].mean(axis=1), normals[triangles].mean(axis=1)
    rows = np.flatnonzero(chosen(middles))[::every]
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([steps] * len(rows))
    along = np.linspace(0, length, steps)[:, None]
    places = [middles[row] + along * out[row] - [0, 0, 1] * along**2 * droop for row in rows]
    curves.attributes["position"].data.foreach_set(
        "vector", np.concatenate(places).astype(np.float32).ravel()
    )
    if radius:
        thin = np.tile(np.linspace(radius, 0.3 * radius, steps, dtype=np.float32), len(rows))
        curves.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", thin)
    return link("Hair", curves)
