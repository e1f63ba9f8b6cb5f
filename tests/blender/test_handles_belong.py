# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles belong to their object: they move with it, unless the switch World holds them in the world."""

import tempfile

import numpy as np
import pytest
from support.blender import inside

if inside.IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.baking import at, cache_file
    from support.blender.live import step
    from support.blender.panels import drawn
    from support.blender.pins import pin

    from addon.core.geometry.spaces import space_of
    from addon.handles import empties
    from addon.live import sessions, stored
    from addon.names import HANDLES, HANDLES_MARK

pytestmark = pytest.mark.in_blender

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
    shape, mark = local_points(bar), stored.mark(bar)
    before = np.linalg.inv(bar.matrix_world) @ np.array(empty.matrix_world)
    globals()[change](bar)
    step(refined=True)
    assert np.array_equal(local_points(bar), shape) and stored.mark(bar) == mark
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
        assert off[0] < (1e-3 if is_live else 1e-5) and max(off[1:]) < 1e-5, off

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
    into.collections[0].override_hierarchy_create(context.scene, context.view_layer, do_fully_editable=True)
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
