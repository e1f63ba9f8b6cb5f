# SPDX-License-Identifier: GPL-3.0-or-later
"""Characters with bones, and their skins."""

import bpy
import numpy as np
from support.blender import scenes
from support.blender.stacks import add_modifier, armature
from support.geometry.characters import FOOT, HIP, LEG, trousers
from support.geometry.nudge import nudged

import arapfields as af
from addon.blender import mesh_arrays, vertex_groups
from addon.core.geometry.spaces import space_of
from addon.core.runtime.jobs import run_to_completion
from addon.handles import empties
from addon.handles.native_handles import native_handles

# A body with two legs, an armature, cloth and an eye, for skinning.

KNEE = 0.38
SIDES = "LR"


def link(name, data):
    item = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(item)
    return item


def mesh_of(name, vertices, triangles):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(nudged(vertices).tolist(), [], np.asarray(triangles).tolist())
    return link(name, mesh)


def person(half=False):
    """(body, rig): the whole body, or its half with x ≥ 0."""
    vertices, triangles = af.extract_surface(trousers(), 24)[:2]
    if half:
        triangles = triangles[(vertices[triangles][:, :, 0] > -1e-6).all(axis=1)]
        used, triangles = np.unique(triangles, return_inverse=True)
        vertices, triangles = vertices[used], triangles.reshape(-1, 3)
    body = mesh_of("Body", vertices, triangles)
    rig = link("Rig", bpy.data.armatures.new("Rig"))

    def add(bones):
        def bone(name, head, tail, parent=None):
            one = bones.new(name)
            one.head, one.tail, one.parent = head, tail, parent
            return one

        spine = bone("Spine", (0, 0, HIP), (0, 0, HIP + 0.5))
        helper = bone("Helper", (0, 0.5, HIP), (0, 0.5, HIP + 0.2), spine)
        helper.use_deform = False
        for side, x in zip(SIDES, (LEG, -LEG), strict=True):
            thigh = bone(f"Thigh.{side}", (x, 0, HIP), (x, 0, KNEE), spine)
            bone(f"Shin.{side}", (x, 0, KNEE), (x, 0, FOOT), thigh)

    scenes.edit_bones(rig, add)
    return body, rig


def shirt(body):
    """A band of the body's surface, moved outwards a little."""
    points = scenes.world_points(body)
    body.data.calc_loop_triangles()
    triangles = np.array([t.vertices for t in body.data.loop_triangles])
    normals = np.array([v.normal for v in body.data.vertices])
    band = (points[triangles][:, :, 2] > HIP).all(axis=1)
    used, corners = np.unique(triangles[band], return_inverse=True)
    return mesh_of("Shirt", (points + 0.02 * normals)[used], corners.reshape(-1, 3))


def eye():
    bpy.ops.mesh.primitive_uv_sphere_add(segments=8, ring_count=6, radius=0.05, location=(LEG, 0.1, 0.2))
    return bpy.context.object


def weights_of(item, names):
    """(n, groups) weights of an object's vertices; 0 where there is no group."""
    result = np.zeros((len(item.data.vertices), len(names)))
    columns = {g.index: names.index(g.name) for g in item.vertex_groups if g.name in names}
    for vertex in item.data.vertices:
        for entry in vertex.groups:
            if entry.group in columns:
                result[vertex.index, columns[entry.group]] = entry.weight
    return result


# Native handles of bones.


def handles_of(bar):
    """[(indices of its samples, its (4, 4) motion)] of the bar's native handles."""
    space, mesh = space_of(bar.matrix_world), mesh_arrays.read(bpy.context, bar, in_place=True)
    reading = vertex_groups.read_weights(bpy.context, bar, empties.group_names(bar), in_place=True)
    handles = empties.solve_handles(bar, space, run_to_completion(reading))
    samples = af.sample_mesh(space.to_solve(mesh.vertices), mesh.triangles, count=2000, seed=0)
    return [(native.samples, native.motion) for native in native_handles(af, handles, mesh, samples)]


def rigged_bar(with_groups=True):
    """(bar, rig): a bar and an armature of two bones, which deforms it by a modifier `with_groups`."""
    bar = scenes.bar()
    if with_groups:
        add_modifier(bar, "ARMATURE")
        rig = bar.modifiers["Armature"].object
    else:
        rig = armature()
    rig.pose.bones["Second"].rotation_euler.z = 0.0
    scenes.activate(rig, bar)
    return bar, rig
