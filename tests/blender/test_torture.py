# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that artists really have: each ends in a result or in an error that names what is wrong."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bmesh
    import bpy
    from support.blender import scenes

    from addon.field_modifier import motion
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

BROKEN = {  # name → what the message says
    "empty": "Mesh: the mesh is empty",
    "one vertex": "Mesh: the mesh has no faces",
    "loose edges": "Mesh: the mesh has no faces",
    "not finite": "Mesh: 1 vertices have no finite position, the first is 5",
    "flat object": "Mesh: its scale flattens it",
    "no handle": "Drag a pin or add a handle first",
    "handle outside": "No part of the surface lies in the rest region of Moving",
    "edit mode": "Mesh is in Edit Mode",
    "all faces degenerate": "Mesh: ",
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_cannot_be_deformed_is_named(case):
    item, _, moving = scenes.bar_with_handles("Mesh")
    mesh = item.data
    if case in ("empty", "one vertex", "loose edges"):
        mesh.clear_geometry()
        points = {"empty": [], "one vertex": [(0, 0, 0)], "loose edges": [(0, 0, 0), (1, 0, 0)]}[case]
        mesh.from_pydata(points, [(0, 1)] if case == "loose edges" else [], [])
    elif case == "not finite":
        mesh.vertices[5].co.x = float("nan")
    elif case == "flat object":
        item.scale.z = 0
    elif case == "no handle":
        for _ in range(2):
            bpy.ops.arapfields.remove_handle()
    elif case == "handle outside":
        moving.location.y += 50
        bpy.ops.arapfields.set_rest(all=True)
    elif case == "edit mode":
        bpy.ops.object.mode_set(mode="EDIT")
    elif case == "all faces degenerate":
        scenes.set_positions(mesh, np.zeros((len(mesh.vertices), 3)))
    objects = set(bpy.data.objects)
    try:
        with pytest.raises(RuntimeError) as caught:
            bpy.ops.arapfields.deform(**scenes.NEW)
    finally:
        if case == "edit mode":
            bpy.ops.object.mode_set(mode="OBJECT")
    print(caught.value)
    assert BROKEN[case] in str(caught.value), str(caught.value)
    assert "Error" not in str(caught.value).replace("Error: ", "", 1), str(caught.value)
    assert set(bpy.data.objects) == objects


@pytest.mark.parametrize("name", ["set_rest", "add_handle", "mirror_handle", "remove_field"])
def test_a_scale_that_flattens_is_named_by_what_needs_its_inverse(name):
    item, _, moving = scenes.bar_with_handles("Mesh")
    item.arapfields.moved_by = "WRAP"
    motion.bind(bpy.context, item)
    motion.write(item, motion.Motion(np.ones((len(item.data.vertices), 3))))
    item.scale.z = 0
    scenes.activate(moving, item)
    with pytest.raises(RuntimeError, match="Mesh: its scale flattens it; give every axis a scale"):
        getattr(bpy.ops.arapfields, name)()


def test_without_a_mesh_the_operators_say_so():
    for name in ("fit", "deform", "stylize", "extract", "add_handle"):
        with pytest.raises(RuntimeError, match="Select a mesh object"):
            getattr(bpy.ops.arapfields, name)()


ODD = [
    "open",
    "non-manifold",
    "n-gons",
    "loose parts beside",
    "zero-area faces",
    "inside out",
    "two islands",
    "doubled vertices",
    "multi-user",
    "instanced by a collection",
    "hidden",
]


@pytest.mark.parametrize("case", ODD)
def test_odd_meshes_deform(case):
    item, _, moving = scenes.bar_with_handles("Mesh")
    edited = bmesh.new()
    edited.from_mesh(item.data)
    edited.verts.ensure_lookup_table()
    edited.faces.ensure_lookup_table()
    if case == "open":
        bmesh.ops.delete(edited, geom=edited.faces[:40], context="FACES")
    elif case == "non-manifold":
        edited.faces.new([edited.verts[0], edited.verts[20], edited.verts[60]])
        edited.faces.new([edited.verts[0], edited.verts[20], edited.verts[90]])
    elif case == "n-gons":
        bmesh.ops.dissolve_limit(edited, angle_limit=0.1, verts=edited.verts, edges=edited.edges)
    elif case == "loose parts beside":
        loose = [edited.verts.new((0, 0, z)) for z in (1, 2)]
        edited.edges.new(loose)
        edited.verts.new((0, 2, 0))
    elif case == "zero-area faces":
        point = edited.verts[0].co.copy()
        edited.faces.new([edited.verts.new(point) for _ in range(3)])
    elif case == "inside out":
        bmesh.ops.reverse_faces(edited, faces=edited.faces)
    elif case == "two islands":
        copied = bmesh.ops.duplicate(edited, geom=[*edited.verts, *edited.edges, *edited.faces])["geom"]
        moved = [v for v in copied if isinstance(v, bmesh.types.BMVert)]
        bmesh.ops.translate(edited, vec=(0, 1.2, 0), verts=moved)
    elif case == "doubled vertices":
        bmesh.ops.split_edges(edited, edges=edited.edges)
    edited.to_mesh(item.data)
    edited.free()
    if case == "multi-user":
        other = bpy.data.objects.new("Other", item.data)
        bpy.context.collection.objects.link(other)
    elif case == "instanced by a collection":
        group = bpy.data.collections.new("Group")
        group.objects.link(item)
        instance = bpy.data.objects.new("Instance", None)
        instance.instance_type, instance.instance_collection = "COLLECTION", group
        bpy.context.collection.objects.link(instance)
    elif case == "hidden":
        item.hide_render = True
    bpy.context.view_layer.update()
    before = scenes.world_points(item)
    moving.location.z += 0.3
    assert bpy.ops.arapfields.deform(output="WARP", **scenes.NEW) == {"FINISHED"}
    after = scenes.world_points(bpy.data.objects["Mesh_deformed"])
    assert len(after) == len(before) and np.isfinite(after).all()
    right = before[:, 0] > 0.8
    assert np.abs((after - before)[right].mean(axis=0)[2] - 0.3) < 0.15
    assert np.array_equal(scenes.world_points(item), before)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_tiny_and_huge_units(scale):
    """Geometry itself of that size, and the scene's unit scale: results are the plain ones, scaled."""
    results = {}
    for size in (1.0, scale):
        item, fixed, moving = scenes.bar_with_handles("Mesh")
        bpy.context.scene.unit_settings.scale_length = 1 / size
        scenes.set_positions(item.data, size * scenes.world_points(item))
        for empty in (fixed, moving):
            empty.location, empty.scale = size * empty.location, size * empty.scale
        bpy.context.view_layer.update()
        bpy.ops.arapfields.set_rest(all=True)
        moving.location.z += 0.3 * size
        scenes.activate(item)
        bpy.ops.arapfields.deform(output="WARP", **scenes.NEW)
        results[size] = scenes.world_points(bpy.context.view_layer.objects.active) / size
        for other in list(bpy.data.objects):
            bpy.data.objects.remove(other)
    assert np.abs(results[scale] - results[1.0]).max() < 0.02


def test_half_a_million_triangles():
    """Deformed, styled and live, within the memory and patience of a test."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=500, y_subdivisions=500, size=2)
    item = bpy.context.object
    points = scenes.world_points(item)
    points[:, 2] = 0.1 * np.sin(3 * points[:, 0])
    scenes.set_positions(item.data, points)
    fixed = scenes.cube_empty((-1.0, 0, 0), (0.2, 1.1, 0.3), "Fixed")
    moving = scenes.cube_empty((1.0, 0, 0), (0.2, 1.1, 0.3), "Moving")
    bpy.context.view_layer.update()
    scenes.activate(fixed, moving, item)
    bpy.ops.arapfields.add_handle()
    scenes.activate(item)
    assert len(item.data.polygons) == 250000
    moving.location.z += 0.3
    bpy.ops.arapfields.deform(**scenes.NEW)
    after = scenes.world_points(bpy.data.objects[f"{item.name}_deformed"])
    assert np.isfinite(after).all() and abs((after - points)[points[:, 0] > 0.9][:, 2].mean() - 0.3) < 0.1
    scenes.activate(item)
    bpy.ops.arapfields.live()
    assert sessions.is_live(item)
    sessions.update(bpy.context, wait=60)
    moved = scenes.world_points(item) - points
    assert abs(moved[points[:, 0] > 0.9][:, 2].mean() - 0.3) < 0.1
