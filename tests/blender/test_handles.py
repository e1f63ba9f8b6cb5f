# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles: Empties of every kind, their rest poses, and who owns them."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    from addon.blender.object_references import source_of
    from addon.core.geometry.spaces import space_of
    from addon.handles import empties

pytestmark = pytest.mark.in_blender


def test_selected_empties_become_handles_and_anchors_at_first():
    bar, fixed, moving = scenes.bar_with_handles()
    handles = empties.solve_handles(bar, space_of(bar.matrix_world))
    assert [h.name for h in handles] == ["Fixed", "Moving"] and all(h.is_anchor for h in handles)
    moving.location.z += 1
    bpy.context.view_layer.update()
    handles = empties.solve_handles(bar, space_of(bar.matrix_world))
    assert [h.is_anchor for h in handles] == [True, False]
    assert all(entry.inside > 0 for entry in bar.arapfields.handles)
    assert fixed.arapfields.handle_of == bar and fixed.empty_display_type == "CUBE"


def test_without_empties_one_is_made_at_the_cursor():
    bar = scenes.bar()
    bpy.context.scene.cursor.location = (0.5, 0, 0)
    bpy.ops.arapfields.add_handle()
    (entry,) = bar.arapfields.handles
    assert entry.empty.name == "Handle 1" and tuple(entry.empty.location) == (0.5, 0, 0)
    assert entry.empty.parent == bar and entry.inside > 0


def test_rest_follows_the_source_and_reset_returns_to_it():
    bar, _, moving = scenes.bar_with_handles()
    before = np.array(moving.matrix_world)
    bar.location.x += 5
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.reset_handle(all=True)
    bpy.context.view_layer.update()
    before[0, 3] += 5
    assert np.allclose(np.array(moving.matrix_world), before, atol=1e-5)


def test_set_rest_makes_the_present_pose_the_rest():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.y += 0.1
    bpy.ops.arapfields.set_rest(all=True)
    handles = empties.solve_handles(bar, space_of(bar.matrix_world))
    assert all(h.is_anchor for h in handles)


def test_remove_takes_the_selected_and_may_delete_them():
    bar, fixed, _ = scenes.bar_with_handles()
    scenes.activate(fixed, bar)
    bpy.ops.arapfields.remove_handle()
    assert [e.empty.name for e in bar.arapfields.handles] == ["Moving"]
    assert fixed.arapfields.handle_of is None
    scenes.activate(bar)
    bpy.ops.arapfields.remove_handle(delete=True)
    assert not bar.arapfields.handles and "Moving" not in bpy.data.objects


def test_a_deleted_empty_is_no_handle_any_more():
    bar, _, moving = scenes.bar_with_handles()
    bpy.data.objects.remove(moving)
    assert [e.empty.name for e in empties.used(bar)] == ["Fixed"]


def test_with_a_handle_or_a_result_active_the_source_is_still_found():
    bar, fixed, _ = scenes.bar_with_handles()
    scenes.activate(fixed)
    assert source_of(bpy.context) == bar
    bpy.ops.arapfields.deform(**scenes.NEW)
    assert bpy.context.view_layer.objects.active == fixed
    scenes.activate(bpy.data.objects["Bar_deformed"])
    assert source_of(bpy.context) == bar


def test_a_vertex_group_is_a_handle():
    bar = scenes.bar()
    before = scenes.world_points(bar)
    for name, chosen in (("left", before[:, 0] < -0.8), ("right", before[:, 0] > 0.8)):
        bar.vertex_groups.new(name=name).add(np.flatnonzero(chosen).tolist(), 1.0, "REPLACE")
        bpy.ops.arapfields.add_handle(kind="GROUP", group=name)
        scenes.activate(bar)
    right = bar.arapfields.handles[1].empty
    assert abs(right.location.x - 0.93) < 0.1
    right.location.z += 0.4
    bpy.ops.arapfields.deform(**scenes.NEW | {"iterations": 120})
    shift = scenes.world_points(bpy.data.objects["Bar_deformed"]) - before
    assert np.abs(shift[before[:, 0] < -0.8]).max() < 0.1
    assert np.abs(shift[before[:, 0] > 0.8] - [0, 0, 0.4]).max() < 0.15


def test_a_box_around_the_selected_vertices():
    bar = scenes.bar()
    bar.rotation_euler.z, bar.scale = 0.5, (1, 2, 1)
    bpy.context.view_layer.update()
    local = np.array([v.co for v in bar.data.vertices])
    bar.data.vertices.foreach_set("select", local[:, 0] > 0.8)
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.arapfields.add_handle(place="SELECTION") == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    (entry,) = bar.arapfields.handles
    box = np.linalg.inv(empties.rest_box(bar, entry))
    points = scenes.world_points(bar)
    inside = (np.abs(points @ box[:3, :3].T + box[:3, 3]) <= 1 + 1e-5).all(axis=1)
    assert np.array_equal(inside, local[:, 0] > 0.8) and entry.inside > 0
    bar.data.vertices.foreach_set("select", np.zeros(len(local), bool))
    bar.data.polygons.foreach_set("select", np.zeros(len(bar.data.polygons), bool))
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="Bar has no selected vertices"):
        bpy.ops.arapfields.add_handle(place="SELECTION")


def test_a_mirrored_handle_moves_as_the_mirror_image():
    bar = scenes.bar()
    bar.location, bar.rotation_euler.z = (1, 2, 3), 0.7
    bpy.context.view_layer.update()
    empty = scenes.cube_empty(bar.matrix_world @ bar.data.vertices[0].co, (0.3, 0.2, 0.4), "Arm.L")
    empty.rotation_euler = (0.1, 0.2, 0.3)
    bpy.context.view_layer.update()
    scenes.activate(empty, bar)
    bpy.ops.arapfields.add_handle()
    empty.location.z += 0.3
    empty.rotation_euler.x += 0.4
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.mirror_handle(axis="X") == {"FINISHED"}
    one, two = bar.arapfields.handles
    assert two.empty.name == "Arm.R" and tuple(two.colour) != tuple(one.colour)
    flip = np.diag([-1.0, 1, 1, 1])
    to_local = np.linalg.inv(np.array(bar.matrix_world))
    for box in (empties.rest_box, lambda source, entry: empties.current_box(entry.empty)):
        expected = flip @ to_local @ box(bar, one) @ flip
        assert np.allclose(to_local @ box(bar, two), expected, atol=1e-5)
    bpy.ops.arapfields.mirror_handle(axis="X")
    assert len(bar.arapfields.handles) == 3


def test_a_mirrored_group_takes_the_other_sides_group():
    bar = scenes.bar()
    for name, chosen in (("arm.L", [0, 1, 2]), ("arm.R", [5, 6, 7])):
        bar.vertex_groups.new(name=name).add(chosen, 1.0, "REPLACE")
    bpy.ops.arapfields.add_handle(kind="GROUP", group="arm.L")
    scenes.activate(bar)
    bpy.ops.arapfields.mirror_handle()
    assert bar.arapfields.handles[1].group == "arm.R"
    bar.vertex_groups.remove(bar.vertex_groups["arm.L"])
    scenes.activate(bar)
    bar.arapfields.active_handle = 1
    with pytest.raises(RuntimeError, match=r"no vertex group arm\.L"):
        bpy.ops.arapfields.mirror_handle()


def test_groups_without_an_active_one_do_no_harm():
    """As after Blender's Join of a mesh with groups into one without."""
    one, two = scenes.bar("One"), scenes.bar("Two")
    two.vertex_groups.new(name="Group").add([0, 1, 2], 1.0, "REPLACE")
    scenes.activate(two, one)
    bpy.ops.object.join()
    assert one.vertex_groups and one.vertex_groups.active is None
    assert bpy.ops.arapfields.add_handle(kind="CUBE") == {"FINISHED"} and len(one.arapfields.handles) == 1
    scenes.activate(one)
    for call in (
        lambda: bpy.ops.arapfields.add_handle(kind="GROUP", place="CURSOR"),
        bpy.ops.arapfields.stiffness_preset,
    ):
        with pytest.raises(RuntimeError, match="One: choose a vertex group"):
            call()


def test_a_handle_whose_group_is_cleared_is_named():
    bar, _, _ = scenes.bar_with_handles()
    bar.vertex_groups.new(name="Group").add(list(range(30)), 1.0, "REPLACE")
    bpy.ops.arapfields.add_handle(kind="GROUP", group="Group")
    bar.arapfields.handles[-1].group = ""
    scenes.activate(bar)
    for operator in (bpy.ops.arapfields.deform, bpy.ops.arapfields.live, bpy.ops.arapfields.bake):
        with pytest.raises(RuntimeError, match="Bar: choose a vertex group"):
            operator()
    bar.vertex_groups.clear()
    with pytest.raises(RuntimeError, match="Bar has no vertex group"):
        bpy.ops.arapfields.deform()
