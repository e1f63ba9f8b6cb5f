# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles: made, named, chosen, and whose they are."""

import tempfile

import numpy as np
import pytest
from support.blender import inside
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import animated
    from support.blender.live import pin, step
    from support.blender.panels import drawn, listed
    from support.blender.skins import rigged_bar

    from addon.blender.evaluation import curves_of
    from addon.blender.object_references import owner_of, source_of
    from addon.core.geometry.spaces import rigid_motion, space_of
    from addon.handles import empties
    from addon.handles.empties import name_for
    from addon.live import sessions
    from addon.pin_tool.pins import handles_in_view
    from addon.solver.frame_range import animation_range

pytestmark = pytest.mark.in_blender

# Handles: Empties of every kind, their rest poses, and who owns them.


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


def test_a_pose_is_keyed_on_the_frame_that_is_shown():
    bar, fixed, moving = scenes.bar_with_handles()
    bar.arapfields.handles[0].anchor = True
    for frame, height in ((1, 0.0), (20, 0.5)):
        bpy.context.scene.frame_set(frame)
        moving.location.z = height
        assert bpy.ops.arapfields.key_handle() == {"FINISHED"}
    bpy.context.scene.frame_set(10)
    assert 0.1 < moving.location.z < 0.4
    assert fixed.animation_data is None  # an anchor
    assert {curve.data_path for curve in curves_of(moving.animation_data.action)} == {
        "location",
        "rotation_euler",
    }
    assert tuple(animation_range(bar, "DEFORM")) == (1.0, 20.0)


def test_the_pose_of_bones_that_are_handles_is_keyed():
    bar, rig = rigged_bar()
    scenes.activate(rig, bar)
    bpy.ops.arapfields.add_bones()
    bpy.ops.arapfields.key_handle()
    names = {entry.bone for entry in bar.arapfields.handles}
    keyed = {curve.data_path for curve in curves_of(rig.animation_data.action)}
    assert names and all(f'pose.bones["{name}"].location' in keyed for name in names)


def test_without_handles_no_pose_is_keyed():
    scenes.bar()
    with pytest.raises(RuntimeError, match="The object has no handle"):
        bpy.ops.arapfields.key_handle()


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


# Handles as users see and hit them: rows and Empties together, names, colours, sizes of boxes.


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


# Handles belong to their object: they move with it, unless the switch World holds them in the world.

if inside.IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.baking import at, cache_file
    from support.blender.live import pin, step
    from support.blender.panels import drawn

    from addon.core.geometry.spaces import space_of
    from addon.handles import empties
    from addon.live import live_modifier, sessions
    from addon.names import HANDLES, HANDLES_MARK

LIFTED = (1.0, 0.0, 0.6)  # where the pin on the bar's right end is dragged to


def posed_bar():
    """A live bar whose right end was lifted by a pin. (bar, the pin's Empty)"""
    bar = scenes.bar()
    empty = pin(bar, (1.0, 0.0, 0.25), target=LIFTED)
    step(refined=True)
    return bar, empty


def local_points(item):
    """(n, 3) evaluated vertices in the object's coordinates, single precision."""
    mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    flat = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", flat)
    return flat.reshape(-1, 3)


def moved(bar):
    bar.location = (3.0, -2.0, 7.0)


def turned(bar):
    bar.rotation_euler = (0.3, -0.8, 1.1)


def scaled(bar):
    bar.scale = (2.5, 2.5, 2.5)


def mirrored(bar):
    bar.scale = (-1.0, 1.0, 1.0)


def parented(bar):
    root = scenes.cube_empty((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), "Root")
    bar.parent = root
    root.location, root.rotation_euler = (5.0, 0.0, 1.0), (0.0, 0.7, 0.0)


def constrained(bar):
    goal = scenes.cube_empty((0.0, 4.0, 0.0), (1.0, 1.0, 1.0), "Goal")
    bar.constraints.new("COPY_LOCATION").target = goal


@pytest.mark.parametrize("change", ["moved", "turned", "scaled", "mirrored", "parented", "constrained"])
def test_moving_the_mesh_moves_the_pose(change):
    bar, empty = posed_bar()
    shape, mark = local_points(bar), live_modifier.mark(bar)
    before = np.linalg.inv(bar.matrix_world) @ np.array(empty.matrix_world)
    globals()[change](bar)
    step(refined=True)
    assert np.array_equal(local_points(bar), shape) and live_modifier.mark(bar) == mark
    after = np.linalg.inv(bar.matrix_world) @ np.array(empty.matrix_world)
    assert np.abs(after - before).max() < 1e-5 and not bar.arapfields.handles[0].in_world


def test_a_mesh_scaled_along_one_axis_keeps_its_pose():
    bar, _ = posed_bar()
    shape = local_points(bar)
    bar.scale = (1.0, 1.0, 2.0)
    step(refined=True)
    height = shape[:, 2].max()
    assert abs(local_points(bar)[:, 2].max() - height) < 0.1 * height  # another stretch, another solve


def test_a_handle_in_the_world_stays_there():
    bar, empty = posed_bar()
    before = scenes.world_points(bar)
    bar.arapfields.handles[0].in_world = True
    step(refined=True)
    assert empty.parent is None and np.abs(scenes.world_points(bar) - before).max() < 1e-3
    place = np.array(empty.matrix_world)
    bar.location.x += 0.2
    step(refined=True)
    assert np.array_equal(np.array(empty.matrix_world), place)
    off = np.linalg.norm(scenes.world_points(bar) - LIFTED, axis=1).min()
    assert off < 0.2  # the tip is held, while the mesh has moved on
    bar.arapfields.handles[0].in_world = False
    bpy.context.view_layer.update()
    assert empty.parent == bar and np.allclose(np.array(empty.matrix_world), place, atol=1e-5)


APPLIED = {
    "transforms": lambda: bpy.ops.object.transform_apply(location=True, rotation=True, scale=True),
    "scale": lambda: bpy.ops.object.transform_apply(location=False, rotation=False, scale=True),
    "origin": lambda: bpy.ops.object.origin_set(type="ORIGIN_GEOMETRY"),
}


@pytest.mark.parametrize("what", APPLIED)
@pytest.mark.parametrize("is_live", [False, True])
def test_applied_transforms_keep_shape_and_handles(what, is_live):
    bpy.context.preferences.edit.use_global_undo = True
    bar, empty = posed_bar()
    bar.location, bar.rotation_euler, bar.scale = (1.0, 2.0, 0.5), (0.2, 0.4, -0.3), (2.0, 2.0, 2.0)
    step(refined=True)
    if not is_live:
        sessions.end(bpy.context, bar, keep=True)
    scenes.activate(bar)
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="posed")
    before, place, rest = scenes.world_points(bar), np.array(empty.matrix_world), rest_of(bar)

    def is_as_before():
        bar = bpy.data.objects["Bar"]
        bpy.context.view_layer.update()
        if is_live:
            step(refined=True)
        shape = scenes.world_points(bar)
        now = np.array(bar.arapfields.handles[0].empty.matrix_world)
        off = [np.abs(a - b).max() for a, b in ((shape, before), (now, place), (rest_of(bar), rest))]
        anew = is_live and what == "origin"  # a live shape is solved anew where the origin alone moves
        assert off[0] < (1e-3 if anew else 1e-5) and max(off[1:]) < 1e-5, off

    APPLIED[what]()
    is_as_before()
    bpy.ops.ed.undo_push(message="applied")
    assert bpy.ops.object.select_all(action="DESELECT") == {"FINISHED"}
    bpy.ops.ed.undo_push(message="deselected")
    for _ in range(2):
        bpy.ops.ed.undo()
        is_as_before()
    bpy.ops.ed.redo()
    is_as_before()


def rest_of(bar):
    """(4, 4) the rest box of the first handle, in the world."""
    return empties.rest_box(bar, bar.arapfields.handles[0])


def test_vertices_that_are_edited_move_no_rest_box():
    bar, _ = posed_bar()
    sessions.end(bpy.context, bar, keep=True)
    rest = tuple(bar.arapfields.handles[0].rest)
    bar.data.transform(Matrix.Scale(2.0, 4))
    bar.data.update()
    bpy.context.view_layer.update()
    bar.location.x += 1.0
    bpy.context.view_layer.update()
    assert tuple(bar.arapfields.handles[0].rest) == rest


def test_a_mesh_that_is_animated_takes_its_pose_along():
    bar, _ = posed_bar()
    shape = local_points(bar)
    sessions.end(bpy.context, bar)
    for frame in (1, 3):
        bar.location.x = 5.0 * frame
        bar.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    assert bpy.ops.arapfields.bake(format="PC2", start=1, end=3, filepath=cache_file()) == {"FINISHED"}
    shown = [at(bar, frame) for frame in (1, 2, 3)]
    assert bar.location.x == 15.0 and all(np.array_equal(one, shown[0]) for one in shown)
    assert np.abs(shown[0] - shape).max() < 1e-3


def test_copies_of_mesh_and_handles_belong_together():
    bar, empty = posed_bar()
    sessions.end(bpy.context, bar, keep=True)
    scenes.activate(empty, bar)
    bpy.ops.object.duplicate()
    copied = bpy.context.object
    (entry,) = empties.used(copied)
    assert entry.empty != empty and entry.empty.parent == copied and not entry.in_world
    copied.location.y += 3.0
    scenes.activate(copied)
    shape = local_points(copied)
    bpy.ops.arapfields.live()
    step(refined=True)
    assert np.abs(local_points(copied) - shape).max() < 1e-3


def test_the_empties_lie_in_one_collection_until_the_last_goes():
    bar, empty = posed_bar()
    (home,) = empty.users_collection
    assert home.name == HANDLES and home.get(HANDLES_MARK)
    assert [one for one in bar.users_collection[0].children] == [home]
    other = pin(bar, (-1.0, 0.0, 0.25), target=(-1.0, 0.0, 0.4))
    assert list(other.users_collection) == [home]
    for _ in range(2):
        bpy.ops.arapfields.pin_delete()
    assert HANDLES not in bpy.data.collections


def test_after_a_drag_the_mesh_is_active_and_the_pin_chosen():
    bar, _ = posed_bar()
    pin(bar, (-1.0, 0.0, 0.25), target=(-1.0, 0.0, 0.4))
    assert bpy.context.view_layer.objects.active == bar and bpy.context.selected_objects == [bar]
    assert bar.arapfields.active_handle == 1


def test_an_empty_that_the_object_follows_stays_free():
    bar = scenes.bar()
    leader = scenes.cube_empty((1.0, 0.0, 0.0), (0.2, 0.5, 0.5), "Leader")
    bar.constraints.new("COPY_ROTATION").target = leader
    bpy.context.view_layer.update()
    scenes.activate(leader, bar)
    bpy.ops.arapfields.add_handle()
    assert leader.parent is None and bar.arapfields.handles[0].in_world


def test_handles_of_an_older_file_stay_in_the_world():
    bar, _ = posed_bar()
    sessions.end(bpy.context, bar, keep=True)
    bar.arapfields.handles[0].in_world = True  # as all were
    path = bpy.app.tempdir + "older.blend"
    bpy.ops.wm.save_as_mainfile(filepath=path)
    shape = scenes.world_points(bar)
    bpy.ops.wm.open_mainfile(filepath=path)
    bar = bpy.data.objects["Bar"]
    assert bar.arapfields.handles[0].in_world and np.array_equal(scenes.world_points(bar), shape)


def test_handles_of_a_linked_object_come_along():
    bar, empty = posed_bar()
    sessions.end(bpy.context, bar, keep=True)
    names = bar.name, empty.name
    bar, _ = scenes.from_another_file(bar, empty)
    (entry,) = empties.used(bar)
    assert entry.empty.name == names[1] and entry.empty.parent == bar and not entry.in_world
    handles = empties.solve_handles(bar, space_of(bar.matrix_world))
    assert len(handles) >= 1 and not handles[0].is_anchor


def test_a_library_override_keeps_its_pose_and_takes_its_handles_along():
    """Of a character with handles in a library: it can be placed, and once it is local also posed."""
    bar, _, moving = scenes.bar_with_handles()
    home = bpy.data.collections.new("Character")
    bpy.context.scene.collection.children.link(home)
    for item in (bar, *(entry.empty for entry in bar.arapfields.handles)):
        home.objects.link(item)
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**scenes.QUICK)
    posed, count = scenes.world_points(bar), len(bar.arapfields.handles)
    path = tempfile.mktemp(suffix=".blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.collections = ["Character"]
    context = bpy.context
    context.scene.collection.children.link(into.collections[0])  # Blender 5.3 overrides only what a scene has
    into.collections[0].override_hierarchy_create(context.scene, context.view_layer, do_fully_editable=True)
    context.scene.collection.children.unlink(into.collections[0])
    item = next(one for one in bpy.data.objects if one.override_library and one.type == "MESH")
    context.view_layer.update()
    assert np.array_equal(scenes.world_points(item), posed)
    empties = [entry.empty for entry in item.arapfields.handles]
    assert len(empties) == count and all(one.override_library and one.parent == item for one in empties)
    before = [one.matrix_world.translation.copy() for one in empties]
    item.location.x += 2.0
    context.view_layer.update()
    away = [(one.matrix_world.translation - was).x for one, was in zip(empties, before, strict=True)]
    assert np.allclose(away, 2.0, atol=1e-5)
    assert np.allclose(scenes.world_points(item) - posed, (2, 0, 0), atol=1e-5)
    scenes.activate(item)
    drawn()  # nothing is in the way of the panel
    with pytest.raises(RuntimeError, match="is a library override; make it local first"):
        bpy.ops.arapfields.deform(**scenes.QUICK)
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.make_local(type="ALL")
    context.view_layer.update()
    (item,) = (one for one in context.scene.objects if one.type == "MESH")
    scenes.activate(item)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert np.allclose(scenes.world_points(item) - posed, (2, 0, 0), atol=1e-3)


# Handles that Blender does not evaluate: disabled in viewports, or left out of the view layer.


def by_itself(item):
    item.hide_viewport = True


def by_its_collection(item):
    housed(item).collection.hide_viewport = True


def by_its_view_layer(item):
    housed(item).exclude = True


def housed(item):
    """The view layer's entry of a collection of an object's own."""
    home = bpy.data.collections.new("Home")
    bpy.context.scene.collection.children.link(home)
    home.objects.link(item)
    bpy.context.scene.collection.objects.unlink(item)
    return bpy.context.view_layer.layer_collection.children["Home"]


WAYS = ("by_itself", "by_its_collection", "by_its_view_layer")


@pytest.mark.parametrize("way", WAYS)
def test_a_handle_that_is_disabled_is_where_it_was_when_the_file_is_loaded(way, tmp_path):
    _, _, moving = scenes.bar_with_handles()
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.collection.objects.link(parent)
    moving.parent, parent.location.z = parent, 0.1
    moving.location.z += 0.3
    globals()[way](moving)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "disabled.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "disabled.blend"))
    bar = bpy.data.objects["Bar"]
    scenes.activate(bar)
    rest = scenes.world_points(bar)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    shift = (scenes.world_points(bar) - rest)[rest[:, 0] > 0.9]
    assert np.abs(shift - [0, 0, 0.4]).max() < 0.05


@pytest.mark.parametrize("way", WAYS)
def test_one_that_would_move_is_named_rather_than_baked_where_it_stands(way):
    bar = animated()
    globals()[way](bpy.data.objects["Moving"])
    for operator, given in (("bake", {"start": 1, "end": 3, "format": "KEYS"}), ("live", {}), ("deform", {})):
        with pytest.raises(RuntimeError, match="Moving is disabled in viewports, so that nothing moves it"):
            getattr(bpy.ops.arapfields, operator)(**given)
    assert not bar.modifiers and "Bar_baked" not in bpy.data.objects


@pytest.mark.parametrize("way", WAYS)
def test_an_armature_that_would_move_is_named_unless_others_are_posed_by_it(way):
    bar, rig = rigged_bar()
    bpy.ops.arapfields.add_bones()
    bone = rig.pose.bones["Second"]
    for frame, angle in ((1, 0.0), (3, 0.6)):
        bone.rotation_euler.z = angle
        bone.keyframe_insert("rotation_euler", frame=frame)
    scenes.activate(bar)
    globals()[way](rig)
    with pytest.raises(RuntimeError, match="is disabled in viewports, so that nothing moves it"):
        bpy.ops.arapfields.bake(start=1, end=3, format="KEYS")
    shirt = scenes.bar("Shirt")
    shirt.modifiers.new("Armature", "ARMATURE").object = rig
    scenes.activate(bar)
    assert bpy.ops.arapfields.bake(start=1, end=3, format="KEYS") == {"FINISHED"}
    baked, heights = bpy.data.objects["Bar_baked"], []
    for frame in (1, 3):
        bpy.context.scene.frame_set(frame)
        heights.append(scenes.world_points(baked)[:, 1].max())
    assert heights[1] - heights[0] > 0.2


def test_one_that_is_hidden_by_its_eye_goes_on():
    bar = animated()
    bpy.data.objects["Moving"].hide_set(True)
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.bake(start=1, end=5, format="KEYS") == {"FINISHED"}
    bpy.context.scene.frame_set(5)
    assert scenes.world_points(bpy.data.objects["Bar_baked"])[:, 2].max() > 0.6 and bar.hide_get()


# A copy of an object lists the same handles, whose Empties stay those of the first.

AWAY = (0.0, 3.0, 0.0)  # of the copy


def posed_and_copied(linked):
    """(bar, its copy, the Empty of the one pin by which the bar was posed)."""
    bar = scenes.bar()
    empty = pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.6))
    sessions.end(bpy.context, bar, keep=True)
    scenes.activate(bar)
    bpy.ops.object.duplicate(linked=linked)
    copied = bpy.context.object
    copied.location = AWAY
    bpy.context.view_layer.update()
    return bar, copied, empty


@pytest.mark.parametrize("linked", [False, True])
def test_a_copy_is_not_pulled_to_the_handles_of_the_first(linked):
    _, copied, empty = posed_and_copied(linked)
    shown = scenes.world_points(copied)
    with pytest.raises(RuntimeError, match="Drag a pin or add a handle first"):
        bpy.ops.arapfields.deform(**scenes.QUICK)
    assert [(source.name, entry.empty) for source, entry in handles_in_view(bpy.context)] == [("Bar", empty)]
    own = pin(copied, (-1.0, 3.0, 0.25), target=(-1.0, 3.0, 0.6))
    assert [entry.empty for entry in empties.used(copied)] == [own]
    moved = scenes.world_points(copied)
    assert 0.3 < np.abs(moved - shown).max() < 0.6  # three times as far, if it followed the other's pin
    empty.location.z += 0.3
    step(refined=True)
    assert np.array_equal(scenes.world_points(copied), moved)


def rows(source):
    """The Empties in the list of handles."""
    return [entry.empty for _, entry in listed("ARAPFIELDS_UL_handles", source.arapfields, "handles")]


@pytest.mark.parametrize("linked", [False, True])
def test_a_copy_without_its_empties_has_no_handles(linked):
    """Neither listed nor worked on: the first keeps them, and the copy's own are what is made on it."""
    bar, copied, empty = posed_and_copied(linked)
    texts = drawn()["ARAPFIELDS_PT_handles"]
    assert not rows(copied) and not {"World", "Reach", "(deleted)"} & {*texts}, texts
    assert "press + for a pin" in " ".join(texts)
    for operator in ("remove_handle", "set_rest", "reset_handle", "mirror_handle"):
        with pytest.raises(RuntimeError, match="The object has no handle"):
            getattr(bpy.ops.arapfields, operator)()
    own = pin(copied, (-1.0, 3.0, 0.25), target=(-1.0, 3.0, 0.6))
    assert rows(copied) == [own] and drawn()["ARAPFIELDS_PT_handles"].count("World") == 1
    assert bpy.ops.arapfields.remove_handle(delete=True) == {"FINISHED"}
    assert not rows(copied) and "World" not in drawn()["ARAPFIELDS_PT_handles"]
    assert owner_of(empty) == bar and [entry.empty for entry in empties.used(bar)] == [empty]
    scenes.activate(bar)
    assert rows(bar) == [empty] and drawn()["ARAPFIELDS_PT_handles"].count("World") == 1


def test_a_copy_that_is_left_has_the_handles():
    bar, copied, empty = posed_and_copied(linked=False)
    bpy.data.objects.remove(bar)
    assert [entry.empty for entry in empties.used(copied)] == [empty]


def test_handles_of_a_hidden_object_are_not_in_view():
    bar, copied, empty = posed_and_copied(linked=False)
    own = pin(copied, (-1.0, 3.0, 0.25), target=(-1.0, 3.0, 0.6))
    bar.hide_set(True)
    assert [(source, entry.empty) for source, entry in handles_in_view(bpy.context)] == [(copied, own)]
    result = bpy.data.objects.new("Result", bar.data.copy())
    bpy.context.collection.objects.link(result)
    bar.arapfields.results.add().item = result
    assert empty in [entry.empty for _, entry in handles_in_view(bpy.context)]


def test_a_nodes_modifier_without_a_group_is_no_obstacle():
    bar = scenes.bar()
    bar.modifiers.new("Nodes", "NODES")
    empty = scenes.cube_empty((1, 0, 0), (0.3, 0.6, 0.6))
    bpy.context.view_layer.update()
    scenes.activate(empty, bar)
    assert bpy.ops.arapfields.add_handle() == {"FINISHED"} and empty.parent == bar
