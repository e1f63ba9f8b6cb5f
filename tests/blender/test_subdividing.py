# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles that are too long for a motion: the note, and the button that divides long edges."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.panels import Layout

    from addon.deform import subdividing

pytestmark = pytest.mark.in_blender

ROUNDING = 1e-6  # single precision of positions of size one


def shown(item):
    texts = []
    subdividing.draw_note(Layout(texts), item)
    return texts


def longest_edge(mesh):
    points = np.array([vertex.co for vertex in mesh.vertices])
    edges = np.array([edge.vertices[:] for edge in mesh.edges])
    return np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1).max()


def with_slivers():
    """A bar with handles, and in its top long triangles that reach from end to end."""
    bar, _, moving = scenes.bar_with_handles()
    points = [tuple(vertex.co) for vertex in bar.data.vertices]
    faces = [tuple(face.vertices) for face in bar.data.polygons]
    for y in np.linspace(-0.25, 0.25, 12):
        start = len(points)
        points += [(-1.0, y, 0.25), (1.0, y, 0.25), (-1.0, y + 0.02, 0.25)]
        faces.append((start, start + 1, start + 2))
    bar.data.clear_geometry()
    bar.data.from_pydata(points, [], faces)
    moving.location = (-1.4, 1.5, 0.0)  # turned by 180 degrees and brought back beyond the other end
    moving.rotation_euler = (0.0, 0.0, np.pi)
    bpy.context.view_layer.update()
    return bar


def test_a_run_tells_of_long_triangles_and_the_button_ends_them():
    bar = with_slivers()
    assert shown(bar) == []
    assert bpy.ops.arapfields.deform(samples=1000) == {"FINISHED"}
    count = bar.arapfields.long_triangles
    assert count >= 6
    text = " ".join(shown(bar))
    assert f"{count} triangles are too long for this motion" in text
    assert bpy.ops.arapfields.subdivide.get_rna_type().name in shown(bar)
    assert bpy.ops.arapfields.subdivide(share=0.05) == {"FINISHED"}
    assert shown(bar) == [] and longest_edge(bar.data) <= 0.05 * 2.0 + ROUNDING
    assert bpy.ops.arapfields.deform(samples=1000) == {"FINISHED"}
    assert bar.arapfields.long_triangles == 0


def test_what_lies_on_the_mesh_stays():
    bar = scenes.bar()
    mesh = bar.data
    uv = mesh.uv_layers.new(name="UV")
    for loop in mesh.loops:
        uv.data[loop.index].uv = mesh.vertices[loop.vertex_index].co.xy
    group = bar.vertex_groups.new(name="Group")
    for vertex in mesh.vertices:
        group.add([vertex.index], 0.5 + 0.25 * vertex.co.x, "REPLACE")
    bar.shape_key_add(name="Basis")
    fat = bar.shape_key_add(name="Fat")
    for point in fat.data:
        point.co.y *= 1.5
    corners = np.array([vertex.co for vertex in mesh.vertices])
    for slot in ("one", "two"):
        mesh.materials.append(bpy.data.materials.new(slot))
    mesh.polygons.foreach_set("material_index", np.arange(len(mesh.polygons)) % 2)
    other = bpy.data.objects.new("Other", mesh)  # shares the mesh
    assert bpy.ops.arapfields.subdivide(share=0.04) == {"FINISHED"}
    mesh = bar.data
    points = np.array([vertex.co for vertex in mesh.vertices])
    assert len(points) > 2 * len(corners) == 2 * len(other.data.vertices)
    assert np.array_equal(points[: len(corners)], corners) and longest_edge(mesh) <= 0.04 * 2.0 + ROUNDING
    for loop in mesh.loops:  # linear on each face, and so what the corners had
        place = mesh.vertices[loop.vertex_index].co
        assert np.abs(np.array(mesh.uv_layers["UV"].data[loop.index].uv) - place.xy).max() < 1e-5
    weights = np.array([bar.vertex_groups["Group"].weight(i) for i in range(len(points))])
    assert np.abs(weights - (0.5 + 0.25 * points[:, 0])).max() < 1e-5
    keyed = np.array([point.co for point in mesh.shape_keys.key_blocks["Fat"].data])
    assert np.abs(keyed - points * [1.0, 1.5, 1.0]).max() < 1e-5
    assert {polygon.material_index for polygon in mesh.polygons} == {0, 1}


def test_polygons_are_divided_within():
    mesh = bpy.data.meshes.new("Plate")
    turns = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    mesh.from_pydata([(np.cos(a), np.sin(a), 0.0) for a in turns], [], [range(12)])
    plate = bpy.data.objects.new("Plate", mesh)
    bpy.context.collection.objects.link(plate)
    scenes.activate(plate)
    area = sum(polygon.area for polygon in mesh.polygons)
    assert bpy.ops.arapfields.subdivide(share=0.1) == {"FINISHED"}
    assert (
        longest_edge(plate.data) <= 0.2 + ROUNDING and max(len(p.vertices) for p in plate.data.polygons) <= 4
    )
    assert sum(polygon.area for polygon in plate.data.polygons) == pytest.approx(area, rel=1e-5)


def test_too_many_vertices_are_refused_and_the_mesh_stays():
    bar = scenes.bar()
    other = bpy.data.objects.new("Other", bar.data)
    before, most = len(bar.data.vertices), subdividing.MOST_VERTICES
    subdividing.MOST_VERTICES = 500
    try:
        with pytest.raises(RuntimeError, match="too many vertices"):
            bpy.ops.arapfields.subdivide(share=0.01)
    finally:
        subdividing.MOST_VERTICES = most
    assert len(bar.data.vertices) == before and other.data == bar.data


def test_undo_and_redo_take_the_mesh_and_its_users_along():
    bpy.context.preferences.edit.use_global_undo = True
    bar = scenes.bar()
    mesh = bar.data
    uv = mesh.uv_layers.new(name="UV")
    for loop in mesh.loops:
        uv.data[loop.index].uv = mesh.vertices[loop.vertex_index].co.xy
    bpy.context.collection.objects.link(bpy.data.objects.new("Other", mesh))
    bar.arapfields.long_triangles = 7
    name = bar.name

    def state():
        bar, other = bpy.data.objects[name], bpy.data.objects["Other"]
        points = [tuple(vertex.co) for vertex in bar.data.vertices]
        faces = [tuple(face.vertices) for face in bar.data.polygons]
        uvs = [tuple(loop.uv) for loop in bar.data.uv_layers["UV"].data]
        return points, faces, uvs, other.data == bar.data, bar.arapfields.long_triangles

    bpy.ops.ed.undo_push(message="before")
    before = state()
    assert bpy.ops.arapfields.subdivide(share=0.04) == {"FINISHED"}
    bpy.ops.ed.undo_push(message="after")
    after = state()
    assert len(after[0]) > len(before[0]) and before[3:] == (True, 7) and after[3:] == (False, 0)
    for step, expected in (
        (bpy.ops.ed.undo, before),
        (bpy.ops.ed.redo, after),
        (bpy.ops.ed.undo, before),
    ):
        assert step() == {"FINISHED"}
        assert state() == expected
