# SPDX-License-Identifier: GPL-3.0-or-later
"""The fitted surface inside Blender: fit, cache, extraction, and deforming the surface itself."""

import json

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils.bvhtree import BVHTree
    from support.blender import scenes
    from support.blender.scenes import FIT

    from addon.blender import user_preferences
    from addon.blender.user_preferences import fit_cache
    from addon.core.runtime import jobs
    from addon.surface import staleness
    from addon.surface.source_surface import read_surface

pytestmark = pytest.mark.in_blender

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
    assert read_surface(bpy.context, bar).fit.is_cached and staleness.reason(bar) == ""
    bar.arapfields.fit.iterations += 1
    assert staleness.reason(bar) == "The settings changed since the fit"
    bar.arapfields.fit.iterations -= 1
    bar.location.x += 3  # where it is does not matter
    assert read_surface(bpy.context, bar).fit.key == ours.fit_key
    bpy.context.view_layer.update()
    assert staleness.reason(bar) == ""
    bar.data.vertices[0].co.x += 0.1
    bar.data.update()
    bpy.context.view_layer.update()
    assert staleness.reason(bar) == "The mesh changed since the fit"
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
