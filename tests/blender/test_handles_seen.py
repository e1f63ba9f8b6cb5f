# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles as users see and hit them: rows and Empties together, names, colours, sizes of boxes."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    from addon.blender.object_references import source_of
    from addon.core.geometry.spaces import rigid_motion
    from addon.handles import empties
    from addon.handles.naming import name_for

pytestmark = pytest.mark.in_blender


def test_a_row_and_its_empty_are_chosen_together():
    bar, fixed, moving = scenes.bar_with_handles()
    bar.arapfields.active_handle = 0
    assert bpy.context.selected_objects == [fixed] and bpy.context.object == fixed
    bar.arapfields.active_handle = 1
    assert bpy.context.selected_objects == [moving] and bpy.context.object == moving
    scenes.activate(fixed)
    bpy.context.view_layer.update()
    assert bar.arapfields.active_handle == 0 and bpy.context.selected_objects == [fixed]
    scenes.activate(bar)
    bpy.context.view_layer.update()
    assert bar.arapfields.active_handle == 0 and bpy.context.object == bar


def test_a_row_whose_empty_cannot_be_selected_selects_nothing():
    bar, fixed, moving = scenes.bar_with_handles()
    moving.hide_set(True)
    scenes.activate(bar)
    bar.arapfields.active_handle = 0
    bpy.context.view_layer.update()
    bar.arapfields.active_handle = 1
    bpy.context.view_layer.update()
    assert bar.arapfields.active_handle == 1 and bpy.context.object == fixed
    scenes.activate(bar)
    bpy.ops.object.mode_set(mode="EDIT")
    bar.arapfields.active_handle = 0
    assert bpy.context.object == bar and bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")


def test_handles_are_named_by_what_they_hold():
    bar = scenes.bar()
    bar.location, bar.rotation_euler.z = (1, 2, 3), 0.4
    bpy.context.view_layer.update()
    x = np.array([vertex.co.x for vertex in bar.data.vertices])
    bar.vertex_groups.new(name="body").add(range(len(x)), 0.2, "REPLACE")
    bar.vertex_groups.new(name="DEF-head").add(np.flatnonzero(x > 0.7).tolist(), 0.9, "REPLACE")
    assert name_for(bar, bar.matrix_world @ bar.data.vertices[int(x.argmax())].co, "CUBE") == "head"
    bpy.context.scene.cursor.location = bar.matrix_world @ bar.data.vertices[int(x.argmin())].co
    bpy.ops.arapfields.add_handle(place="CURSOR")
    assert bar.arapfields.handles[0].empty.name == "body"
    scenes.activate(bar)
    bpy.ops.arapfields.add_handle(kind="GROUP", group="DEF-head", place="CURSOR")
    assert bar.arapfields.handles[1].empty.name == "head"


def test_handles_without_a_group_are_numbered_and_names_of_the_users_stay():
    bar = scenes.bar()
    for name in ("Empty", "Jaw", "Empty.001"):
        empty = scenes.cube_empty((0.5, 0, 0), (0.2, 0.2, 0.2), name)
        bpy.context.view_layer.update()
        scenes.activate(empty, bar)
        bpy.ops.arapfields.add_handle()
    assert [entry.empty.name for entry in bar.arapfields.handles] == ["Handle 1", "Jaw", "Handle 3"]
    assert name_for(bar, (0, 0, 0), "PIN") == "Pin 4"
    empty_mesh = bpy.data.objects.new("Nothing", bpy.data.meshes.new("Nothing"))
    bpy.context.collection.objects.link(empty_mesh)
    empty_mesh.vertex_groups.new(name="none")
    assert name_for(empty_mesh, (0, 0, 0), "CUBE") == "Handle 2"  # "Handle 1" is there


def test_a_new_handle_is_selected_to_be_moved_at_once():
    bar = scenes.bar()
    bpy.ops.arapfields.add_handle(place="CURSOR")
    empty = bar.arapfields.handles[0].empty
    assert bpy.context.selected_objects == [empty] and source_of(bpy.context) == bar
    scenes.activate(bar)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.arapfields.add_handle(place="SELECTION")
    assert bpy.context.mode == "EDIT_MESH" and bpy.context.object == bar
    bpy.ops.object.mode_set(mode="OBJECT")


LEAST_DIFFERENCE = 0.12  # in OKLab; about 0.02 is just seen
GREYS = [(0.24, 0.24, 0.24), (0.6, 0.6, 0.6)]  # Blender's viewport and a solid mesh


def oklab(colour):
    """Lightness and two hues of an sRGB colour, in which distances are what is seen (B. Ottosson, 2020)."""
    c = np.asarray(colour, dtype=float)
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    cones = np.array(
        [
            [0.4122214708, 0.5363325363, 0.0514459929],
            [0.2119034982, 0.6806995451, 0.1073969566],
            [0.0883024619, 0.2817188376, 0.6299787005],
        ]
    )
    lab = np.array(
        [
            [0.2104542553, 0.7936177850, -0.0040720468],
            [1.9779984951, -2.4285922050, 0.4505937099],
            [0.0259040371, 0.7827717662, -0.8086757660],
        ]
    )
    return np.cbrt(linear @ cones.T) @ lab.T


def test_sixteen_handles_have_sixteen_distinct_colours():
    bar = scenes.bar()
    for _ in range(16):
        scenes.activate(bar)
        bpy.ops.arapfields.add_handle(place="CURSOR")
    seen = oklab([*(tuple(entry.colour) for entry in bar.arapfields.handles), *GREYS])
    apart = np.linalg.norm(seen[:, None] - seen[None], axis=2) + np.eye(len(seen))
    assert apart.min() > LEAST_DIFFERENCE
    scenes.activate(bar)
    bar.arapfields.active_handle = 3
    freed = tuple(bar.arapfields.handles[3].colour)
    bpy.ops.arapfields.remove_handle(delete=True)
    scenes.activate(bar)
    bpy.ops.arapfields.add_handle(place="CURSOR")
    added = tuple(bar.arapfields.handles[-1].colour)
    others = [tuple(entry.colour) for entry in list(bar.arapfields.handles)[:-1]]
    assert added == freed and added not in others and len(set(others)) == 15


def test_a_box_is_resized_by_a_face_and_keeps_its_motion():
    bar, _, moving = scenes.bar_with_handles()
    bar.rotation_euler.x, bar.location.y = 0.3, 1.0
    moving.location.z, moving.rotation_euler.y = 0.4, 0.5
    bpy.context.view_layer.update()
    scenes.activate(moving)
    entry = bar.arapfields.handles[1]
    rest, now = empties.rest_box(bar, entry), empties.current_box(moving)
    held = entry.inside
    assert bpy.ops.arapfields.resize_handle(axis=0, side=-1, share=0.5) == {"FINISHED"}
    after = empties.rest_box(bar, entry), empties.current_box(moving)
    assert np.allclose(rigid_motion(*after), rigid_motion(rest, now), atol=1e-5)
    for before, box in zip((rest, now), after, strict=True):
        kept, face = np.array([1, 0, 0, 1.0]), np.array([-1, 0, 0, 1.0])
        assert np.allclose(box @ kept, before @ kept, atol=1e-5)
        assert np.allclose(box @ face, before @ np.array([-2, 0, 0, 1.0]), atol=1e-5)
        assert np.allclose(box[:3, 1:3], before[:3, 1:3], atol=1e-5)
    assert entry.inside > held
    bpy.ops.arapfields.resize_handle(axis=1, side=1, share=-5.0)
    assert abs(np.linalg.det(empties.current_box(moving)[:3, :3])) > 1e-4  # never flat
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="Select the Empty of a box"):
        bpy.ops.arapfields.resize_handle(axis=0, side=1, share=0.5)
