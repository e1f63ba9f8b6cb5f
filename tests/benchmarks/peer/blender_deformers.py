# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs Blender's own deformers: blender_deformers.py laplacian|lattice|surface PROBLEM.npz RESULT.npz

PROBLEM holds vertices (n,3), triangles (m,3), fixed (k,) indices and wanted (k,3), where they go; held and
moved, parts of fixed, and motion (4,4) of the moved; cage_vertices, cage_triangles, cage_fixed, cage_wanted.
Each is set up as an artist would: Laplacian Deform with all fixed vertices as anchors; a lattice of POINTS³
whose points go along with the nearer part; Surface Deform by a coarse cage that Laplacian Deform poses.
"""

import os
import sys
import time

import bpy
import numpy as np
from mathutils import Matrix, Vector, kdtree

POINTS = 10


def added(name, vertices, triangles):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], triangles.tolist())
    item = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    return item


def evaluated(item):
    bpy.context.view_layer.update()
    mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    return flat.reshape(-1, 3).astype(float)


def refuse(sentence):
    sys.exit(f"{sentence}")


def posed_by_laplacian(item, fixed, wanted):
    """Binds it at rest, then moves the anchors."""
    group = item.vertex_groups.new(name="anchors")
    group.add([int(row) for row in fixed], 1.0, "REPLACE")
    modifier = item.modifiers.new("Laplacian", "LAPLACIANDEFORM")
    modifier.vertex_group, modifier.iterations = group.name, 5
    bpy.context.view_layer.update()
    bpy.ops.object.laplaciandeform_bind(modifier=modifier.name)
    if not modifier.is_bind:
        refuse("Laplacian Deform does not bind")
    points = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.vertices.foreach_get("co", points)
    points = points.reshape(-1, 3)
    points[fixed] = wanted
    item.data.vertices.foreach_set("co", points.ravel())
    item.data.update()


def laplacian(given):
    item = added("body", given["vertices"], given["triangles"])
    posed_by_laplacian(item, given["fixed"], given["wanted"])
    return evaluated(item)


def lattice(given):
    item = added("body", given["vertices"], given["triangles"])
    low, high = given["vertices"].min(0), given["vertices"].max(0)
    data = bpy.data.lattices.new("lattice")
    data.points_u = data.points_v = data.points_w = POINTS
    cage = bpy.data.objects.new("lattice", data)
    bpy.context.collection.objects.link(cage)
    cage.matrix_world = Matrix.LocRotScale(Vector((low + high) / 2), None, Vector(1.1 * (high - low)))
    modifier = item.modifiers.new("Lattice", "LATTICE")
    modifier.object = cage
    trees = []
    for rows in (given["held"], given["moved"]):
        tree = kdtree.KDTree(len(rows))
        for row in rows:
            tree.insert(given["vertices"][row], 0)
        tree.balance()
        trees.append(tree)
    motion, there = Matrix(given["motion"].tolist()), cage.matrix_world
    bpy.context.view_layer.update()
    for point in data.points:
        place = cage.matrix_world @ point.co
        apart = [tree.find(place)[2] for tree in trees]
        share = apart[0] / max(sum(apart), 1e-9)
        share = share * share * (3 - 2 * share)
        point.co_deform = there.inverted() @ place.lerp(motion @ place, share)
    return evaluated(item)


def surface(given):
    item = added("body", given["vertices"], given["triangles"])
    cage = added("cage", given["cage_vertices"], given["cage_triangles"])
    modifier = item.modifiers.new("Surface", "SURFACE_DEFORM")
    modifier.target = cage
    bpy.context.view_layer.objects.active = item
    bpy.context.view_layer.update()
    bpy.ops.object.surfacedeform_bind(modifier=modifier.name)
    if not modifier.is_bound:
        refuse("Surface Deform does not bind")
    bpy.context.view_layer.objects.active = cage
    posed_by_laplacian(cage, given["cage_fixed"], given["cage_wanted"])
    return evaluated(item)


def main(method, problem, result):
    given = dict(np.load(problem))
    begin, work = time.perf_counter(), time.process_time()
    moved = {"laplacian": laplacian, "lattice": lattice, "surface": surface}[method](given)
    took = time.perf_counter() - begin, time.process_time() - work
    np.savez(result, moved=moved, seconds=took)


if __name__ == "__main__":
    main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)  # bpy 4.5 may wait forever for a thread of its own while the process ends
