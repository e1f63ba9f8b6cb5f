# SPDX-License-Identifier: GPL-3.0-or-later
"""Wrapping an object onto another inside Blender: what moves, what stays, what is refused."""

import types

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

import arapfields as af

if IN_BLENDER:
    import bpy
    from support.blender import character, scenes, wraps
    from support.blender.character import seen_mesh
    from support.blender.wraps import SMALL, bar_and_target, joints, rigged_bar, soup_of

    from addon.blender import mesh_arrays, modifier_stack
    from addon.core.geometry.spaces import space_of
    from addon.core.runtime import jobs
    from addon.field_modifier import inputs
    from addon.wrap import landmarks

pytestmark = pytest.mark.in_blender

ALIKE = 0.05  # between wraps from samples of the mesh and of its implicit surface, in units of the scene
ROUNDED = 0.2  # what a coarse grid takes off an object of three units


def test_the_object_comes_to_lie_on_the_target_and_the_factor_goes_back():
    """The object itself goes there: the factor changes its shape alone."""
    item, target = bar_and_target()
    rest, goal = scenes.world_points(item), scenes.world_points(target)
    for index in (0, len(rest) // 2, len(rest) - 1):
        assert bpy.ops.arapfields.add_landmark(rest=rest[index], on_target=goal[index]) == {"FINISHED"}
    kept = scenes.everything(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    after = scenes.world_points(item)
    assert np.linalg.norm(after - goal, axis=1).mean() < 0.15
    now = scenes.everything(item)
    assert all(now[name] == value for name, value in kept.items())
    modifier = modifier_stack.find(item)
    inputs.put(modifier, "Factor", 0.0)
    bpy.context.view_layer.update()
    plain = scenes.world_points(item)
    size = np.ptp(goal, axis=0).max()
    assert np.linalg.norm(np.mean(plain - after, axis=0)) < 0.01 * size
    assert abs(np.std(plain) / np.std(after) - 1) < 0.02 and np.abs(plain - after).max() < 0.2 * size
    assert np.linalg.norm(np.array(item.matrix_world.translation) - goal.mean(axis=0)) < 0.02 * size


def test_the_object_stays_where_asked_and_where_pins_hold_it():
    item, _ = bar_and_target()
    rest, place = scenes.world_points(item), item.matrix_world.copy()
    for given in ({"move_object": False}, {}):
        if not given:
            bpy.ops.arapfields.pin_add(location=rest[0])
            scenes.activate(item)
        assert bpy.ops.arapfields.wrap(**given, **SMALL) == {"FINISHED"}
        assert item.matrix_world == place
        inputs.put(modifier_stack.find(item), "Factor", 0.0)
        bpy.context.view_layer.update()
        assert np.array_equal(scenes.world_points(item), rest)
        inputs.put(modifier_stack.find(item), "Factor", 1.0)


def test_a_target_that_is_a_child_of_the_object_stays_where_it_is():
    item, target = bar_and_target()
    target.parent, target.matrix_parent_inverse = item, item.matrix_world.inverted()
    bpy.context.view_layer.update()
    goal = scenes.world_points(target)
    scenes.activate(item)
    for _ in range(2):
        assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
        assert np.array_equal(scenes.world_points(target), goal)
        away = af.MeshSdf(goal, mesh_arrays.triangles(target.data))(scenes.world_points(item))
        assert np.abs(away).mean() < 0.02 * np.ptp(goal, axis=0).max()


def test_landmarks_are_pairs_of_empties_that_move_with_both():
    item, target = bar_and_target()
    rest, goal = scenes.world_points(item), scenes.world_points(target)
    bpy.ops.arapfields.add_landmark(rest=rest[0] + 0.01, on_target=goal[0] - 0.01)
    (entry,) = landmarks.used(item)
    assert entry.rest.parent == item and entry.on_target.parent == target
    assert np.abs(np.array(entry.rest.matrix_world.translation) - rest[0]).max() < 0.02
    target.location.z += 1.0
    bpy.context.view_layer.update()
    ((_, moved),) = landmarks.read(item, space_of(item.matrix_world, item.name))
    assert abs(moved[2] - goal[0][2] - 1.0) < 0.02
    assert bpy.ops.arapfields.remove_landmark(index=0) == {"FINISHED"}
    assert not landmarks.used(item) and not [o for o in bpy.data.objects if o.type == "EMPTY"]


def test_pairs_are_suggested_once():
    item, target = bar_and_target()
    bpy.ops.arapfields.add_landmark(
        rest=scenes.world_points(item)[0], on_target=scenes.world_points(target)[0]
    )
    before = len(bpy.data.objects)
    assert bpy.ops.arapfields.suggest_landmarks(count=6) == {"FINISHED"}
    made = len(landmarks.used(item)) - 1
    assert 4 <= made <= 6 and len(bpy.data.objects) == before + 2 * made
    corners = np.array([t.vertices for t in target.data.polygons])
    ends = [np.array(entry.on_target.matrix_world.translation) for entry in landmarks.used(item)]
    assert np.abs(af.MeshSdf(scenes.world_points(target), triangles_of(corners))(ends)).max() < 0.03
    assert all(entry.rest.parent == item for entry in landmarks.used(item))
    assert bpy.ops.arapfields.suggest_landmarks(count=6) == {"FINISHED"}
    assert len(landmarks.used(item)) == made + 1  # none lies where there is one


def triangles_of(faces):
    return np.concatenate([faces[:, [0, k, k + 1]] for k in range(1, faces.shape[1] - 1)])


def test_a_pair_that_lies_is_marked_in_the_list():
    item, target = bar_and_target()
    rest, goal = scenes.world_points(item), scenes.world_points(target)
    rows = [int(np.argmax(rest @ way)) for way in np.array(list(np.ndindex(2, 2, 2))) - 0.5]
    for row, there in zip(rows, [*rows[:6], rows[0], rows[7]], strict=True):
        bpy.ops.arapfields.add_landmark(rest=rest[row], on_target=goal[there] + (0.05 if row != there else 0))
    bpy.ops.arapfields.add_landmark(rest=rest[0], on_target=goal[0])
    bpy.data.objects.remove(item.arapfields.wrap.landmarks[1].rest)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    assert [row for row, pair in enumerate(item.arapfields.wrap.landmarks) if pair.left_out] == [6]


def test_what_cannot_be_wrapped_onto_is_named_and_nothing_is_lost():
    item, target = bar_and_target()
    kept = scenes.everything(item)
    empty = bpy.data.objects.new("Nothing", bpy.data.meshes.new("Nothing"))
    bpy.context.collection.objects.link(empty)
    item.arapfields.wrap.onto = empty
    with pytest.raises(RuntimeError, match="Nothing: the mesh is empty"):
        bpy.ops.arapfields.wrap(**SMALL)
    empty.data.from_pydata([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [], [(0, 1, 2)])
    with pytest.raises(RuntimeError, match="Nothing: its faces have no area"):
        bpy.ops.arapfields.wrap(**SMALL)
    with pytest.raises(RuntimeError, match="no object Gone"):
        bpy.ops.arapfields.wrap(onto="Gone", **SMALL)
    with pytest.raises(RuntimeError, match="Bar is no other mesh object"):
        bpy.ops.arapfields.wrap(onto="Bar", **SMALL)
    item.arapfields.wrap.onto = target
    bpy.ops.arapfields.add_landmark(rest=(0, 0, 0), on_target=(3, 1, 0))
    entry = item.arapfields.wrap.landmarks[0]
    entry.on_target.location.z += 50
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=r"landmarks\[0\]"):
        bpy.ops.arapfields.wrap(**SMALL)
    bpy.data.objects.remove(target)
    with pytest.raises(RuntimeError, match="Choose the object to wrap Bar onto"):
        bpy.ops.arapfields.wrap(**SMALL)
    assert scenes.everything(item) == kept and not item.modifiers


def test_a_rigged_template_goes_onto_a_soup_with_its_uvs_groups_and_keys():
    item, _ = rigged_bar()
    soup = soup_of(item)
    item.arapfields.wrap.onto = soup
    kept = scenes.everything(item)
    keys = [tuple(p.co) for p in item.data.shape_keys.key_blocks["Fat"].data]
    rest = scenes.world_points(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    now = scenes.everything(item)
    assert all(now[name] == value for name, value in kept.items())
    assert [tuple(p.co) for p in item.data.shape_keys.key_blocks["Fat"].data] == keys
    wrapped = scenes.world_points(item)
    target = scenes.world_points(soup)
    corners = np.array([t.vertices for t in soup.data.polygons])
    diagonal = np.linalg.norm(np.ptp(target, axis=0))
    assert np.abs(af.MeshSdf(target, corners)(wrapped)).mean() < 0.02 * diagonal
    assert np.linalg.norm(wrapped - rest, axis=1).min() > 1.0


@pytest.mark.slow  # half a minute
def test_a_rigged_character_goes_onto_a_scan_with_its_bones():
    body, rig = wraps.rigged_character()
    body.arapfields.wrap.onto, shape = wraps.scan_of(wraps.grown_parts())
    scenes.activate(body)
    for rest, on_target in wraps.landmarks_of_people():
        bpy.ops.arapfields.add_landmark(rest=rest, on_target=on_target)

    def depths(posed=True):
        points, _, triangles = seen_mesh(body)
        return -af.MeshSdf(points, triangles)(wraps.joints(rig, posed))

    within = depths() > 0.005
    kept = scenes.everything(body), [tuple(p.co) for p in body.data.shape_keys.key_blocks["Belly"].data]
    assert bpy.ops.arapfields.wrap() == {"FINISHED"}
    now = scenes.everything(body)
    assert all(now[name] == value for name, value in kept[0].items())
    assert [tuple(p.co) for p in body.data.shape_keys.key_blocks["Belly"].data] == kept[1]
    points = seen_mesh(body)[0]
    assert np.abs(shape(points)).mean() < 0.003 * np.linalg.norm(np.ptp(points, axis=0))
    assert [m.type for m in body.modifiers] == ["MIRROR", "NODES", "ARMATURE"]
    assert (depths()[within] > 0.005).all()
    character.pose(types.SimpleNamespace(rig=rig))
    after = seen_mesh(body)[0]
    raised = (after - points)[points[:, 0] > 0.6]
    assert raised[:, 2].mean() > 0.3 and np.isfinite(after).all()
    assert (depths()[within] > 0.005).all()


def test_bones_are_fitted_from_their_own_rest_each_time_and_can_be_reset():
    item, rig = rigged_bar()
    item.arapfields.wrap.onto = soup_of(item)
    rest = joints(rig, posed=False)
    with pytest.raises(RuntimeError, match="No bones were fitted"):
        bpy.ops.arapfields.reset_bones()
    rig.pose.bones["Upper"].rotation_mode = "XYZ"
    rig.pose.bones["Upper"].rotation_euler.x = 0.4
    rig.hide_set(True)
    ends = []
    for name in ("Upper", "Arm"):
        rig.data.bones["Upper"].name = name
        assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
        assert [m.type for m in item.modifiers] == ["NODES", "ARMATURE"]
        assert bpy.context.view_layer.objects.active == item and rig.hide_get() and rig.mode == "OBJECT"
        ends.append(joints(rig, posed=False))
    assert np.abs(ends[1] - ends[0]).max() < 1e-5 and np.linalg.norm(ends[0] - rest, axis=1).min() > 1.0
    assert abs(rig.pose.bones["Arm"].rotation_euler.x - 0.4) < 1e-6
    assert bpy.ops.arapfields.reset_bones() == {"FINISHED"}
    assert np.abs(joints(rig, posed=False) - rest).max() < 1e-5
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    assert bpy.ops.arapfields.remove_field() == {"FINISHED"}
    assert np.abs(joints(rig, posed=False) - rest).max() < 1e-5 and len(item.modifiers) == 1
    assert bpy.ops.arapfields.wrap(fit_rig=False, **SMALL) == {"FINISHED"}
    assert [m.type for m in item.modifiers] == ["ARMATURE", "NODES"]
    assert np.abs(joints(rig, posed=False) - rest).max() < 1e-5
    scenes.activate(item)


def test_bones_that_cannot_be_fitted_and_wraps_that_fail_leave_the_stack():
    item, rig = rigged_bar()
    item.arapfields.wrap.onto = soup_of(item)
    rest = joints(rig, posed=False)
    assert bpy.ops.arapfields.wrap(fit_rig=False, **SMALL) == {"FINISHED"}
    bpy.ops.arapfields.add_landmark(rest=(0, 0, 0), on_target=(3, 1, 0))
    entry = item.arapfields.wrap.landmarks[0]
    entry.on_target.location.z += 50
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=r"landmarks\[0\]"):
        bpy.ops.arapfields.wrap(**SMALL)
    assert [m.type for m in item.modifiers] == ["ARMATURE", "NODES"] and not item.arapfields.under_rig
    assert bpy.ops.arapfields.remove_landmark(index=0) == {"FINISHED"}
    for home in list(rig.users_collection):
        home.objects.unlink(rig)
    jobs.board.messages.clear()
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    assert any("The bones of Rig stay" in str(text) for text in jobs.messages())
    assert np.array_equal(joints(rig, posed=False), rest)


@pytest.mark.parametrize("output", ["SURFACE", "REMESH"])
def test_a_remeshed_wrap_lies_where_the_warped_one_lies(output):
    """The new object's place is the similarity of the mesh's own motion, whatever it is made of."""
    places = {}
    for kind in ("WARP", output):
        item, _ = bar_and_target()
        settings = item.arapfields
        settings.output, settings.result, settings.resolution = kind, "NEW", 24
        assert settings.wrap.move_object
        assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
        made = bpy.data.objects["Bar_wrapped"]
        places[kind] = np.array(made.matrix_world), scenes.world_points(made)
        for one in (made, item, bpy.data.objects["Scan"]):
            bpy.data.objects.remove(one)
    (place, points), (other_place, other_points) = places.values()
    assert np.abs(place - other_place).max() < ALIKE
    low, high = points.min(axis=0), points.max(axis=0)
    assert (
        np.abs(other_points.min(axis=0) - low).max() < 0.2
        and np.abs(other_points.max(axis=0) - high).max() < 0.2
    )
