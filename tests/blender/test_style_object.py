# SPDX-License-Identifier: GPL-3.0-or-later
"""Any mesh object as a style."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.styles import SETTINGS, ball

    from addon.solver import style_object
    from addon.stylize import ball as picture

pytestmark = pytest.mark.in_blender


def test_a_ball_as_a_style_changes_nothing_and_an_open_box_is_closed():
    item = ball()
    before = scenes.world_points(item)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(5, 0, 0), radius=0.3)
    other = bpy.context.object
    scenes.activate(item)
    item.arapfields.stylize.style_object = other
    bpy.ops.arapfields.stylize(style="OBJECT", **SETTINGS)
    after = scenes.world_points(bpy.data.objects["Ball_stylized"])
    assert np.abs(after - before).max() < 1e-6
    bpy.ops.mesh.primitive_cube_add(location=(5, 0, 0))
    box = bpy.context.object
    faces = [list(face.vertices) for face in box.data.polygons][1:]
    corners = [list(vertex.co) for vertex in box.data.vertices]
    box.data.clear_geometry()
    box.data.from_pydata(corners, [], faces)
    scenes.activate(item)
    item.arapfields.stylize.style_object = box
    bpy.ops.arapfields.stylize(style="OBJECT", result="NEW", iterations=60, samples=2000)
    points = scenes.world_points(bpy.data.objects["Ball_stylized"])
    points -= points.mean(axis=0)
    assert np.linalg.norm(points, axis=1).max() / np.abs(points).max() > 1.25  # of a ball 1


def test_faces_of_a_mesh_opens_as_object():
    """Files hold a style's number; that of the style which this one took in was the last."""
    style = ball().arapfields.stylize
    items = style.bl_rna.properties["style"].enum_items
    assert items["OBJECT"].value == 15 and len(items) == 16
    box = bpy.data.objects.new("Box", bpy.data.meshes.new("Box"))
    style.style, style.style_object = "OBJECT", box
    assert style.style == "OBJECT"


def test_the_picture_of_a_style_object_is_a_ball():
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    of_ball = picture.picture(style_object.style_of(bpy.context.object)[0])
    bpy.ops.mesh.primitive_cube_add()
    of_box = picture.picture(style_object.style_of(bpy.context.object)[0])
    middle = slice(picture.SIZE // 4, -picture.SIZE // 4)
    shades = [len(np.unique(np.round(p[middle, middle, 0], 2))) for p in (of_ball, of_box)]
    assert shades[0] > 30 and np.array_equal(of_ball[..., 3], of_box[..., 3])
    assert np.median(np.abs(np.diff(of_box[middle, middle, 0], axis=0))) < 1e-6  # flat sides
    assert np.median(np.abs(np.diff(of_ball[middle, middle, 0], axis=0))) > 1e-3
