# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes as sources: their surface, odd meshes, files beside Blender's importers."""

import json

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER
from support.files import odd_meshes

from arapfields.cli.meshes import formats

if IN_BLENDER:
    import bmesh
    import bpy
    from mathutils.bvhtree import BVHTree
    from support.blender import scenes
    from support.blender.scenes import FIT

    from addon.blender import user_preferences
    from addon.blender.user_preferences import fit_cache
    from addon.core.runtime import jobs
    from addon.field_modifier import motion
    from addon.live import sessions
    from addon.surface import source_surface
    from addon.surface.source_surface import read_surface

pytestmark = pytest.mark.in_blender

# The fitted surface inside Blender: fit, cache, extraction, and deforming the surface itself.

NEAR = 0.06  # of the bar's size: what so short a fit reaches


def test_a_fit_is_cached_and_goes_stale_with_the_mesh():
    fit_cache().clear()
    bar = scenes.bar()
    for name, value in FIT.items():
        setattr(bar.arapfields.fit, name, value)
    assert bpy.ops.arapfields.fit() == {"FINISHED"}
    ours = bar.arapfields
    assert fit_cache().path(ours.fit_key).exists() and fit_cache().size() > 0
    assert json.loads(ours.fit_report)["near_mean"] < 0.05
    assert read_surface(bpy.context, bar).fit.is_cached and source_surface.outdated(bar) == ""
    bar.arapfields.fit.iterations += 1
    assert source_surface.outdated(bar) == "The settings changed since the fit"
    bar.arapfields.fit.iterations -= 1
    bar.location.x += 3  # where it is does not matter
    assert read_surface(bpy.context, bar).fit.key == ours.fit_key
    bpy.context.view_layer.update()
    assert source_surface.outdated(bar) == ""
    bar.data.vertices[0].co.x += 0.1
    bar.data.update()
    bpy.context.view_layer.update()
    assert source_surface.outdated(bar) == "The mesh changed since the fit"
    assert not read_surface(bpy.context, bar).fit.is_cached
    bpy.ops.arapfields.clear_cache()
    assert fit_cache().size() == 0


def test_a_fit_that_cannot_be_kept_is_used_and_said():
    bar = scenes.bar()
    before = user_preferences.cache_folder
    user_preferences.cache_folder = lambda: __file__  # a file, where no folder can be made
    for name, value in FIT.items():
        setattr(bar.arapfields.fit, name, value)
    assert bpy.ops.arapfields.extract(resolution=24, surface="FIT") == {"FINISHED"}
    assert len(bpy.data.objects["Bar_implicit"].data.vertices) > 100
    (level, text), (_, done) = jobs.messages()[::-1]
    assert level == "WARNING" and "could not be kept" in text
    assert "Bar_implicit" in done
    assert bpy.ops.arapfields.fit() == {"FINISHED"}
    assert bar.arapfields.fit_key == ""
    user_preferences.cache_folder = before


def test_extraction_lies_on_the_source_in_world_space():
    bar = scenes.bar()
    bar.scale, bar.location, bar.rotation_euler = (1, -1, 1), (4, 5, 6), (0.3, 0.4, 0.5)
    bar.data.materials.append(bpy.data.materials.new("skin"))
    bpy.context.view_layer.update()
    for name, value in FIT.items():
        setattr(bar.arapfields.fit, name, value)
    bpy.ops.arapfields.extract(resolution=48, surface="FIT")
    result = bpy.data.objects["Bar_implicit"]
    surface, source = scenes.world_points(result), scenes.world_points(bar)
    assert len(result.data.polygons) > 500 and all(face.use_smooth for face in result.data.polygons)
    assert np.abs(surface.mean(axis=0) - source.mean(axis=0)).max() < NEAR
    assert np.abs(np.ptp(surface, axis=0) - np.ptp(source, axis=0)).max() < 4 * NEAR
    assert [m.name for m in result.data.materials] == ["skin"]
    centre = np.array(result.matrix_local.inverted() @ bar.location)
    outward = [f.normal.dot(f.center) > 0 for f in result.data.polygons]
    assert np.mean(outward) > 0.95 and np.abs(centre).max() < 1e-3
    bar.arapfields.normals = "FLAT"
    scenes.activate(bar)
    bpy.ops.arapfields.extract(resolution=48)
    assert not any(face.use_smooth for face in bpy.data.objects["Bar_implicit"].data.polygons)


def striped(bar):
    """Gives the bar's right half the second of three materials, and its tip the third."""
    for name in ("left", "right", "tip"):
        bar.data.materials.append(bpy.data.materials.new(name))
    centers = np.array([face.center.x for face in bar.data.polygons])
    indices = (centers > 0).astype(np.int32) + (centers > 0.7)
    bar.data.polygons.foreach_set("material_index", indices)


def stripes(item, rest_of=lambda points: points):
    """The share of an object's faces with the material of their place at rest."""
    centers = rest_of(np.array([face.center for face in item.data.polygons]))[:, 0]
    names = np.array([item.material_slots[face.material_index].material.name for face in item.data.polygons])
    expected = np.where(centers > 0.75, "tip", np.where(centers > 0, "right", "left"))
    near = np.abs(centers[:, None] - [0.0, 0.75]).min(axis=1) < 0.08  # a face of the grid
    assert set(names) == {"left", "right", "tip"}
    return np.mean((names == expected)[~near])


@pytest.mark.parametrize("result", ["NEW", "REPLACE"])
@pytest.mark.parametrize("output", ["SURFACE", "REMESH"])
def test_a_new_surface_has_the_materials_where_the_mesh_has_them(output, result):
    bar, _, moving = scenes.bar_with_handles()
    striped(bar)
    moving.location.y += 0.1
    bar.modifiers.new("Finer", "SUBSURF").subdivision_type = "SIMPLE"
    bpy.ops.arapfields.extract(resolution=40, surface="EXACT")
    assert stripes(bpy.context.view_layer.objects.active) == 1.0
    scenes.activate(bar)
    settings = scenes.QUICK | {"result": result, "resolution": 40}
    assert bpy.ops.arapfields.deform(output=output, surface="EXACT", **settings) == {"FINISHED"}
    item = bpy.context.view_layer.objects.active
    assert (item == bar) == (result == "REPLACE") and len(item.data.polygons) > 1000
    assert [slot.material.name for slot in item.material_slots] == ["left", "right", "tip"]
    assert stripes(item) == 1.0  # a bar that bends to the side keeps its x, but for some hundredths


def test_the_surface_is_deformed_like_the_mesh():
    bar, _, moving = scenes.bar_with_handles()
    for name, value in FIT.items():
        setattr(bar.arapfields.fit, name, value)
    moving.location.z += 0.4
    settings = scenes.NEW | {"iterations": 120}
    bpy.ops.arapfields.deform(output="SURFACE", surface="FIT", resolution=48, **settings)
    surface = bpy.context.view_layer.objects.active
    scenes.activate(bar)
    bpy.ops.arapfields.deform(output="WARP", surface="FIT", **settings)
    warped = bpy.context.view_layer.objects.active
    assert surface != warped
    tree = BVHTree.FromObject(surface, bpy.context.evaluated_depsgraph_get())
    off = [tree.find_nearest(v.co)[3] for v in warped.data.vertices]
    assert np.mean(off) < NEAR


def test_exact_surfaces_need_no_fit():
    fit_cache().clear()
    bar, _, moving = scenes.bar_with_handles()
    assert bar.arapfields.surface == "EXACT"
    assert bpy.ops.arapfields.extract(resolution=48, refine_thin=True) == {"FINISHED"}
    graph = bpy.context.evaluated_depsgraph_get()
    tree, surface = BVHTree.FromObject(bar, graph), bpy.data.objects["Bar_implicit"]
    cell = 2 * max(bar.dimensions) / 1.5 / 47
    assert max(tree.find_nearest(v.co)[3] for v in surface.data.vertices) < 0.5 * cell
    scenes.activate(bar)
    moving.location.z += 0.4
    settings = scenes.QUICK | {"iterations": 60}
    meshes = {}
    for output in ("SURFACE", "REMESH"):
        scenes.activate(bar)
        bpy.ops.arapfields.deform(output=output, resolution=48, **settings)
        meshes[output] = bpy.context.view_layer.objects.active
    assert fit_cache().size() == 0 and bar.arapfields.fit_key == ""
    tree = BVHTree.FromObject(meshes["SURFACE"], bpy.context.evaluated_depsgraph_get())
    assert np.mean([tree.find_nearest(v.co)[3] for v in meshes["REMESH"].data.vertices]) < cell


def test_a_remeshed_surface_is_even_where_the_shape_is_stretched():
    def lengths(item):
        mesh = item.data
        assert not mesh.validate()
        points = scenes.world_points(item)
        ends = np.array([edge.vertices[:] for edge in mesh.edges])
        return np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)

    bar, _, moving = scenes.bar_with_handles()
    for name, value in FIT.items():
        setattr(bar.arapfields.fit, name, value)
    moving.location.x += 0.8
    settings = scenes.NEW | {"iterations": 120, "resolution": 48}
    results = {}
    for output in ("SURFACE", "REMESH"):
        scenes.activate(bar)
        bpy.ops.arapfields.deform(output=output, **settings)
        results[output] = bpy.context.view_layer.objects.active
    assert results["SURFACE"] != results["REMESH"] and len(bar.arapfields.results) == 2
    assert json.loads(results["REMESH"]["arapfields_report"])["failures"] == 0
    moved, even = lengths(results["SURFACE"]), lengths(results["REMESH"])
    step = np.ptp(scenes.world_points(results["REMESH"]), axis=0).max() / 48
    assert even.max() < 2.5 * step and moved.max() / np.median(moved) > even.max() / np.median(even)
    tree = BVHTree.FromObject(results["SURFACE"], bpy.context.evaluated_depsgraph_get())
    off = [tree.find_nearest(v.co)[3] for v in results["REMESH"].data.vertices]
    assert np.mean(off) < NEAR


# Meshes that artists really have: each ends in a result or in an error that names what is wrong.

BROKEN = {  # name → what the message says
    "empty": "Mesh: the mesh is empty",
    "one vertex": "Mesh: the mesh has no faces",
    "loose edges": "Mesh: the mesh has no faces",
    "not finite": "Mesh: 1 vertices are at invalid locations, the first is 5",
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


# The command line's readers and writers of mesh files beside Blender's importers, file by file.

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
