# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that a source's field carries: solved, live, baked, rendered, undone, lost."""

import tempfile

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Vector
    from support.blender import scenes, wraps
    from support.blender.live import step
    from support.blender.riders import WITH_PENCILS, body, link, rider, shown, taken
    from support.blender.scenes import camera, delete
    from support.blender.skins import rigged_bar

    import arapfields as af
    from addon.blender import mesh_arrays, modifier_stack
    from addon.blender.evaluation import curves_of
    from addon.blender.object_references import owner_of
    from addon.core.runtime import jobs
    from addon.field_modifier import node_group
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

# Objects that a source's field moves as well.

CLOSE = 1e-5  # single precision of positions of size one


KINDS = ["MESH", "CURVES", "GREASEPENCIL", "CURVE", "LATTICE", "EMPTY", "ARMATURE"]


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_follows_live_and_comes_back(kind):
    bar, moving = body()
    item = rider(kind)
    bpy.context.view_layer.update()
    before = shown(item)
    scenes.activate(item, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    counts = len(item.modifiers), len(bpy.data.node_groups)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    assert np.abs(shown(item) - before).max() < 0.01
    moving.location.z += 0.4
    moving.rotation_euler.x = 0.3
    step(refined=True)
    session = sessions.live[bar.session_uid]
    assert not session.carrying.warnings
    after = taken(session, before)  # the bar's own coordinates are the world's
    spread = 0.05 if kind in ("EMPTY", "ARMATURE") else CLOSE
    assert np.abs(shown(item) - after).max() < spread and np.abs(after - before).max() > 0.3
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert np.abs(shown(item) - before).max() < CLOSE
    assert (len(item.modifiers), len(bpy.data.node_groups)) == counts
    if kind in ("CURVE", "LATTICE"):
        assert item.data.shape_keys is None


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_goes_with_a_solve_and_is_released(kind):
    bar, moving = body()
    item = rider(kind)
    bpy.context.view_layer.update()
    before = shown(item)
    scenes.activate(item, bar)
    bpy.ops.arapfields.carry()
    moving.location.z += 0.4
    scenes.activate(bar)
    for _ in range(2):  # a second one starts from rest again
        assert bpy.ops.arapfields.deform(field="radial", samples=1000) == {"FINISHED"}
    assert np.abs(shown(item) - before - [0, 0, 0.4]).max() < 0.1
    bpy.ops.arapfields.release()
    assert np.abs(shown(item) - before).max() < CLOSE
    assert not bar.arapfields.carried and item.arapfields.carried_by is None


def test_what_is_rigid_stays_so():
    bar, moving = body()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0.7, 0, 0.2), segments=12, ring_count=8)
    eye = bpy.context.object
    eye.parent = bar
    eye.location.x += 0.05
    bpy.context.view_layer.update()
    before = scenes.world_points(eye)
    scenes.activate(eye, bar)
    bpy.ops.arapfields.carry(way="RIGID")
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    moving.rotation_euler.y = -0.5
    step(refined=True)
    after = scenes.world_points(eye)
    one, other = (points - points.mean(axis=0) for points in (before, after))
    assert np.abs(np.linalg.norm(one, axis=1) - np.linalg.norm(other, axis=1)).max() < CLOSE
    assert np.linalg.norm(after.mean(axis=0) - before.mean(axis=0)) > 0.2
    assert np.abs(other - one).max() > 0.01  # it turns as well
    assert not eye.modifiers and np.allclose(eye.location[0], 0.75)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert np.abs(scenes.world_points(eye) - before).max() < CLOSE and not any(eye.delta_location)


def test_an_eye_on_a_bone_does_not_move_twice():
    """A child of a bone that is a handle: it is where the field has it, not the bone's motion on top."""
    bar, rig = rigged_bar()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0.8, 0, 0.2), segments=12, ring_count=8)
    eye = bpy.context.object
    before = scenes.world_points(eye)
    rig.data.bones.active = rig.data.bones["Second"]
    scenes.activate(eye, rig)
    bpy.ops.object.parent_set(type="BONE", keep_transform=True)
    bpy.context.view_layer.update()
    assert np.abs(scenes.world_points(eye) - before).max() < CLOSE
    scenes.activate(rig, bar)
    bpy.ops.arapfields.add_bones()
    rig.pose.bones["Second"].rotation_euler.z = 0.7  # posed before it is carried
    bpy.context.view_layer.update()
    scenes.activate(eye, bar)
    for way in ("RIGID", "FOLLOW"):
        assert bpy.ops.arapfields.carry(way=way) == {"FINISHED"}
        bpy.ops.arapfields.live()
        for angle in (0.7, -0.5):
            rig.pose.bones["Second"].rotation_euler.z = angle
            step(refined=True)
            step(refined=True)
            after = taken(sessions.live[bar.session_uid], before)
            assert np.abs(scenes.world_points(eye) - after).max() < 0.02
        bpy.ops.arapfields.live()


def test_a_sleeve_that_a_shrinkwrap_lays_on_the_body_does_not_move_twice():
    """The field moves it first, then it is laid on the body that has moved."""
    bar, _, moving = scenes.bar_with_handles()
    sleeve = scenes.bar("Sleeve", 0.6)
    for point in sleeve.data.vertices:
        point.co.y, point.co.z = 1.3 * point.co.y, 1.3 * point.co.z
    laid = sleeve.modifiers.new("Laid", "SHRINKWRAP")
    laid.target, laid.wrap_mode, laid.offset = bar, "OUTSIDE", 0.05
    bpy.context.view_layer.update()

    def away():
        bpy.context.view_layer.update()
        body = af.MeshSdf(scenes.world_points(bar), mesh_arrays.triangles(bar.data))
        return body(scenes.world_points(sleeve))

    before = away()
    scenes.activate(sleeve, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.deform(samples=1000) == {"FINISHED"}
    assert [one.type for one in sleeve.modifiers] == ["NODES", "SHRINKWRAP"]
    assert np.abs(away() - before).max() < 0.02
    bpy.ops.arapfields.release(all=True)
    assert [one.type for one in sleeve.modifiers] == ["SHRINKWRAP"]


# Carried objects that are edited, lost or refused, that share an armature, and bakes.

NEAR = 0.02  # of a bar of length two: between the mesh and what it carries the field is interpolated


def test_what_moves_anyway_is_named_and_left():
    bar, _ = body()
    patch, spot, cage = rider("MESH"), rider("EMPTY"), rider("LATTICE")
    for item in (spot, cage):
        scenes.activate(item, bar)
        bpy.ops.arapfields.carry()
    patch.parent = spot
    scenes.activate(patch, bar)
    with pytest.raises(RuntimeError, match="Patch moves with Spot already"):
        bpy.ops.arapfields.carry()
    patch.parent = None
    patch.modifiers.new("Cage", "LATTICE").object = cage
    with pytest.raises(RuntimeError, match="Patch moves with Cage already"):
        bpy.ops.arapfields.carry()
    assert len(bar.arapfields.carried) == 2


@pytest.mark.parametrize("kind", ["ARMATURE", "LATTICE", "parent", "grandparent", "constraint"])
def test_what_moves_the_source_is_not_carried_by_it(kind):
    """It would move the source, whose field moves it, without an end."""
    bar, _ = body()
    item = rider(kind if kind.isupper() else "EMPTY")
    if kind in ("ARMATURE", "LATTICE"):
        modifier = bar.modifiers.new(kind, kind)
        modifier.object = item
    elif kind == "constraint":
        bar.constraints.new("CHILD_OF").target = item
    else:
        bar.parent = item if kind == "parent" else link("Between", None)
        bar.parent.parent = None if kind == "parent" else item
    bpy.context.view_layer.update()
    scenes.activate(item, bar)
    with pytest.raises(RuntimeError, match=f"{item.name} moves Bar already"):
        bpy.ops.arapfields.carry()
    assert not bar.arapfields.carried
    if kind in ("ARMATURE", "LATTICE"):
        modifier.show_viewport = False
        assert bpy.ops.arapfields.carry() == {"FINISHED"}
        modifier.show_viewport = True
        scenes.activate(bar)
        assert bpy.ops.arapfields.live() == {"FINISHED"}
        assert [text for _, text in jobs.messages() if f"{item.name} moves Bar already" in text]


def test_bad_ones_are_named_and_the_rest_goes_on():
    bar, moving = body()
    good = rider("MESH")
    bad = [link(name, bpy.data.meshes.new(name)) for name in ("Hollow", "Gone", "Dark", "Torn", "Lone")]
    for item in bad[1:]:
        item.data.from_pydata([(0.9, 0, 0.3), (1.0, 0, 0.3), (0.9, 0.1, 0.3)], [], [(0, 1, 2)])
    scenes.activate(good, *bad, bar)
    bpy.ops.arapfields.carry()
    assert len(bar.arapfields.carried) == 6
    bad[2].hide_set(True)
    bad[3].data.vertices[0].co.x = float("nan")
    bpy.data.objects.remove(bad[1])
    before = shown(good)
    scenes.activate(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    messages = "\n".join(text for _, text in jobs.messages())
    for words in (
        "Hollow is empty",
        "Gone, which Bar carries, was deleted",
        "Dark is hidden",
        "Torn has points",
    ):
        assert words in messages, messages
    moving.location.z += 0.4
    step()
    assert np.abs(shown(good) - before - [0, 0, 0.4]).max() < 0.1
    bad[4].data.clear_geometry()
    bpy.context.view_layer.update()
    moving.location.z += 0.1
    for _ in range(3):
        step()
    assert sessions.is_live(bar) and np.abs(shown(good) - before - [0, 0, 0.5]).max() < 0.1
    bpy.data.objects.remove(bad[4])
    moving.location.z -= 0.1
    for _ in range(3):
        step()
    assert sessions.is_live(bar) and np.abs(shown(good) - before - [0, 0, 0.4]).max() < 0.1
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert np.abs(shown(good) - before).max() < 1e-5 and len(bar.arapfields.carried) == 6


def test_a_moved_or_edited_one_follows_from_where_it_is():
    bar, moving = body()
    patch, spot = rider("MESH"), rider("EMPTY")
    scenes.activate(patch, spot, bar)
    bpy.ops.arapfields.carry()
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    session = sessions.live[bar.session_uid]
    patch.location.x -= 0.5
    spot.location.x -= 0.5
    rest = np.array([v.co for v in patch.data.vertices]) + np.array(patch.location)
    for _ in range(2):
        step(refined=True)
    assert np.abs(shown(patch) - taken(session, rest)).max() < CLOSE
    assert np.abs(shown(spot)[0] - taken(session, np.array([spot.location]))[0]).max() < 0.02
    patch.data.vertices[0].co.z += 0.1
    patch.data.update()
    rest[0, 2] += 0.1
    for _ in range(2):
        step(refined=True)
    assert sessions.live[bar.session_uid] is session
    assert np.abs(shown(patch) - taken(session, rest)).max() < CLOSE


def test_one_under_a_parent_rests_once_the_shape_does():
    """Its parent's part of its place is the same, to the bit, wherever the field has moved it."""
    bar, moving = body()
    spot, parent = rider("EMPTY"), bpy.data.objects.new("Parent", None)
    bpy.context.collection.objects.link(parent)
    parent.location, parent.rotation_euler, parent.scale = (0.3, 0.2, 0.1), (0.4, 0.7, 1.1), (1.3, 1.3, 1.3)
    spot.parent = parent
    bpy.context.view_layer.update()
    scenes.activate(spot, bar)
    assert bpy.ops.arapfields.carry(way="RIGID") == {"FINISHED"}
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    moving.location.z += 0.4
    step(refined=True)
    session, seen = sessions.live[bar.session_uid], set()
    for turn in range(5):
        parent.rotation_euler.z += 0.1  # it goes on from another place
        step(refined=True)
        step(refined=True)
        requested = session.requested
        for _ in range(3):
            step()
            seen.add((turn, session.requested is requested))
    assert all(rests for _, rests in seen)


def test_a_shirt_of_the_same_armature_is_not_posed_twice():
    bar, rig = rigged_bar()
    shirt = bar.copy()
    shirt.data, shirt.name = bar.data.copy(), "Shirt"
    bpy.context.collection.objects.link(shirt)
    for vertex in shirt.data.vertices:
        vertex.co.y *= 1.1
        vertex.co.z *= 1.1
    rest = np.array([vertex.co for vertex in shirt.data.vertices])
    scenes.activate(rig, bar)
    bpy.ops.arapfields.add_bones()
    scenes.activate(shirt, bar)
    bpy.ops.arapfields.carry()
    bpy.ops.arapfields.live()
    rig.pose.bones["Second"].rotation_euler.z = 0.7
    step(refined=True)
    after = taken(sessions.live[bar.session_uid], rest)
    assert np.abs(scenes.world_points(shirt) - after).max() < CLOSE
    assert not shirt.modifiers["Armature"].show_viewport
    bpy.ops.arapfields.live()
    assert shirt.modifiers["Armature"].show_viewport and len(shirt.modifiers) == 1


def test_a_group_of_a_bone_that_is_missing_is_named():
    bar, _ = rigged_bar()
    bpy.ops.arapfields.add_bones()
    bar.vertex_groups.remove(bar.vertex_groups["Second"])
    scenes.activate(bar)
    for run in (bpy.ops.arapfields.deform, bpy.ops.arapfields.live):
        with pytest.raises(RuntimeError, match="Bar has no vertex group Second"):
            run()
    assert len(bar.arapfields.handles) == 2 and bar.modifiers["Armature"].show_viewport
    assert len(bar.modifiers) == 1


def hung_on(rig, item):
    """Makes it a child of a bone, where it is."""
    bpy.context.view_layer.update()
    world = item.matrix_world.copy()
    item.parent, item.parent_type, item.parent_bone = rig, "BONE", "Upper"
    bpy.context.view_layer.update()
    item.matrix_world = world


def patch_at(item):
    """(patch, number of the bar's vertex at which its first vertex lies)."""
    corner = int(np.argmax([v.co.x + v.co.y for v in item.data.vertices]))
    at = Vector(scenes.world_points(item)[corner])
    patch = link("Patch", bpy.data.meshes.new("Patch"))
    patch.data.from_pydata([at, at - Vector((0.1, 0, 0)), at - Vector((0, 0, 0.1))], [], [(0, 1, 2)])
    return patch, corner


@pytest.mark.parametrize("posed", [False, True])
def test_what_hangs_on_a_fitted_bone_lies_where_the_field_takes_it(posed):
    """A patch on the bar's side, an Empty and a lamp, children of a bone: not moved by field and bone."""
    item, rig = wraps.rigged_bar()
    item.arapfields.wrap.onto = wraps.soup_of(item)
    patch, corner = patch_at(item)
    at = scenes.world_points(item)[corner]
    spot, lamp = link("Spot", None, at), link("Lamp", bpy.data.lights.new("Lamp", "POINT"), at)
    spot.empty_display_size = 0.05
    for one in (patch, spot, lamp):
        hung_on(rig, one)
    if posed:
        rig.pose.bones["Upper"].rotation_mode = "XYZ"
        rig.pose.bones["Upper"].rotation_euler.x = 0.4
    bpy.context.view_layer.update()
    scenes.activate(patch, spot, lamp, item)
    bpy.ops.arapfields.carry()
    seen = []
    for _ in range(2):
        assert bpy.ops.arapfields.wrap(**wraps.SMALL) == {"FINISHED"}
        bpy.context.view_layer.update()
        on_bar = scenes.world_points(item)[corner]
        seen.append([on_bar, scenes.world_points(patch)[0], np.array(spot.matrix_world.translation)])
        near = np.linalg.norm(np.array(seen[-1][1:]) - on_bar, axis=1)
        assert near[0] < NEAR and near[1] < 2 * NEAR, near
    assert np.abs(np.array(seen[1]) - seen[0]).max() < 1e-4
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    copies = {item["arapfields_copy_of"]: item for item in bpy.data.objects if "arapfields_copy_of" in item}
    assert sorted(copies) == ["Lamp", "Patch", "Spot"]
    twin = bpy.data.objects["Rig Soup"]
    assert all((one.parent, one.parent_bone) == (twin, "Upper") for one in copies.values())
    for one in (rig, twin):
        one.pose.bones["Upper"].rotation_euler.x = 0.0
    bpy.context.view_layer.update()
    on_bar = scenes.world_points(item)[corner]
    assert np.linalg.norm(scenes.world_points(copies["Patch"])[0] - on_bar) < 3 * NEAR
    assert np.linalg.norm(np.array(copies["Spot"].matrix_world.translation) - on_bar) < 3 * NEAR
    assert bpy.ops.arapfields.reset_bones() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert np.linalg.norm(scenes.world_points(patch)[0] - on_bar) < NEAR
    assert np.linalg.norm(np.array(spot.matrix_world.translation) - on_bar) < 2 * NEAR


def test_what_hangs_on_a_posed_bone_goes_with_a_sequence_after_a_wrap():
    """The sequence plays behind the armature, whose bones the wrap has fitted."""
    item, rig = wraps.rigged_bar()
    item.arapfields.wrap.onto = wraps.soup_of(item)
    for name, value in wraps.SMALL.items():
        setattr(item.arapfields.wrap, name, value)
    patch, corner = patch_at(item)
    hung_on(rig, patch)
    scenes.activate(patch, item)
    bpy.ops.arapfields.carry()
    assert bpy.ops.arapfields.wrap() == {"FINISHED"}
    rig.pose.bones["Upper"].rotation_mode = "XYZ"
    rig.pose.bones["Upper"].rotation_euler.x = 0.4
    scenes.activate(item)
    assert bpy.ops.arapfields.wrap_sequence(start=1, end=2, folder=tempfile.mkdtemp()) == {"FINISHED"}
    bpy.context.scene.frame_set(2)
    assert np.linalg.norm(scenes.world_points(patch)[0] - scenes.world_points(item)[corner]) < NEAR


# Carried objects in bakes, renders, and through undo.


@pytest.mark.parametrize("format", ["PC2", "KEYS"])
def test_all_are_baked_at_once(format):
    bar, moving = body()
    kinds = ["MESH", "CURVE", "EMPTY", "ARMATURE", "CURVES", *(["GREASEPENCIL"] if WITH_PENCILS else [])]
    items = [rider(kind) for kind in kinds]
    bpy.context.view_layer.update()
    rest = [shown(item) for item in items]
    scenes.activate(*items, bar)
    bpy.ops.arapfields.carry()
    for frame, height in ((1, 0.0), (3, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    for curve in curves_of(moving.animation_data.action):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    scenes.activate(bar)
    folder = tempfile.mkdtemp()
    assert bpy.ops.arapfields.bake(format=format, start=1, end=3, folder=folder) == {"FINISHED"}
    patch = items[0] if format == "PC2" else bpy.data.objects["Patch_baked"]
    for frame in (3, 1, 2):
        bpy.context.scene.frame_set(frame)
        for item, before in zip([patch, *items[1:]], rest, strict=True):
            shift = shown(item) - before
            assert np.abs(shift - [0, 0, 0.2 * (frame - 1)]).max() < 0.08, (item.name, frame)
    if format == "PC2":
        scenes.activate(bar)
        assert bpy.ops.arapfields.remove_bake() == {"FINISHED"}
        kinds = [modifier.name for item in (bar, items[0], *items[4:]) for modifier in item.modifiers]
        assert not any("Cache" in name for name in kinds), kinds
    assert bpy.ops.arapfields.live() == {"FINISHED"}  # shown in place of the bake
    moving.location.z = 0.3
    step(refined=True)
    assert all(
        np.abs(shown(item) - before - [0, 0, 0.3]).max() < 0.1
        for item, before in zip(items[4:], rest[4:], strict=True)
    )
    bpy.ops.arapfields.live()
    bpy.ops.arapfields.release(all=True)
    for item, before in zip(items[4:], rest[4:], strict=True):
        assert np.abs(shown(item) - before).max() < CLOSE and not item.modifiers
    assert not any(data.name.endswith("_played") for data in (*bpy.data.objects, *bpy.data.meshes))


@pytest.mark.parametrize("mode", ["XYZ", "QUATERNION"])
def test_what_turns_round_is_keyed_without_a_turn_back(mode):
    """Between frames, as motion blur sees them, it is between where it is at the frames."""
    bar, moving = body()
    spot, tail = rider("EMPTY"), rider("ARMATURE")
    spot.rotation_mode = tail.pose.bones[0].rotation_mode = mode
    scenes.activate(spot, tail, bar)
    bpy.ops.arapfields.carry()
    for frame in range(1, 8):
        for handle in (moving, bpy.data.objects["Fixed"]):
            handle.rotation_euler.x = 1.0 * (frame - 1)
            handle.keyframe_insert("rotation_euler", frame=frame)
    scenes.activate(bar)
    bpy.ops.arapfields.bake(start=1, end=7, folder=tempfile.mkdtemp())

    def at(item, frame):
        bpy.context.scene.frame_set(int(frame), subframe=frame % 1)
        return shown(item)

    for item in (spot, tail):
        for frame in range(1, 7):
            ends, middle = [at(item, frame), at(item, frame + 1)], at(item, frame + 0.5)
            step = np.abs(ends[1] - ends[0]).max()
            assert all(np.abs(middle - end).max() < 0.9 * step for end in ends), (item.name, frame)


@pytest.mark.parametrize("how", ["remove_bake", "release"])
def test_keys_of_a_bake_go_with_it_and_the_users_own_stay(how):
    bar, moving = body()
    spot, cord, own = rider("EMPTY"), rider("CURVE"), rider("EMPTY")
    own.keyframe_insert("delta_location", frame=1)
    for frame, height in ((1, 0.0), (6, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(spot, cord, own, bar)
    bpy.ops.arapfields.carry()
    bpy.context.scene.frame_set(1)
    rest = [shown(item) for item in (spot, cord)]
    scenes.activate(bar)
    folder = tempfile.mkdtemp()
    for start, end in ((1, 6), (3, 4)):
        assert bpy.ops.arapfields.bake(start=start, end=end, folder=folder) == {"FINISHED"}
        for action in (spot.animation_data.action, cord.data.shape_keys.animation_data.action):
            frames = {point.co.x for curve in curves_of(action) for point in curve.keyframe_points}
            assert frames == set(range(start, end + 1)), frames
    assert getattr(bpy.ops.arapfields, how)(**({"all": True} if how == "release" else {})) == {"FINISHED"}
    for frame in (1, 4):
        bpy.context.scene.frame_set(frame)
        for item, before in zip((spot, cord), rest, strict=True):
            assert np.abs(shown(item) - before).max() < CLOSE
    left = {curve.data_path for curve in curves_of(own.animation_data.action)}
    assert "delta_location" in left and spot.animation_data.action is None


def test_undo_and_redo_take_all_along():
    bpy.context.preferences.edit.use_global_undo = True
    bar, moving = body()
    names = [rider(kind).name for kind in ("MESH", "CURVES", "CURVE", "EMPTY", "ARMATURE")]
    bpy.context.view_layer.update()
    scenes.activate(*(bpy.data.objects[name] for name in names), bar)
    bpy.ops.arapfields.carry()
    moving.location.z += 0.4
    scenes.activate(bar)

    def places():
        return [shown(bpy.data.objects[name]) for name in names]

    bpy.ops.ed.undo_push(message="before")
    before = places()
    assert bpy.ops.arapfields.deform(field="radial", samples=1000) == {"FINISHED"}
    bpy.ops.ed.undo_push(message="after")
    after = places()
    assert all(np.abs(one - other).max() > 0.2 for one, other in zip(before, after, strict=True))
    for step, expected in ((bpy.ops.ed.undo, before), (bpy.ops.ed.redo, after), (bpy.ops.ed.undo, before)):
        step()
        found = places()
        assert max(np.abs(one - other).max() for one, other in zip(found, expected, strict=True)) < CLOSE
    bar = bpy.data.objects["Bar"]
    scenes.activate(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    bpy.ops.arapfields.live()
    found = places()
    assert max(np.abs(one - other).max() for one, other in zip(found, before, strict=True)) < CLOSE


def test_renders_show_all_at_the_frame_that_is_rendered():
    scene = camera(16)
    bar, moving = body()
    items = [rider(kind) for kind in ("MESH", "EMPTY", "CURVES")]
    bpy.context.view_layer.update()
    rest = [shown(item) for item in items]
    scenes.activate(*items, bar)
    bpy.ops.arapfields.carry()
    for frame, height in ((1, 0.0), (3, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    scene.frame_start, scene.frame_end = 3, 3
    scene.render.filepath = f"{tempfile.mkdtemp()}/"
    bpy.ops.render.render(animation=True)
    for item, before in zip(items, rest, strict=True):
        assert np.abs(shown(item) - before - [0, 0, 0.4]).max() < 0.1, item.name


@pytest.mark.parametrize("kind", ["EMPTY", "ARMATURE"])
def test_files_of_versions_without_a_kind_of_base_come_back(kind):
    bar, moving = body()
    item = rider(kind)
    rest = shown(item)
    scenes.activate(item, bar)
    bpy.ops.arapfields.carry()
    moving.location.z += 0.4
    assert bpy.ops.arapfields.deform(samples=1000) == {"FINISHED"}
    assert np.abs(shown(item) - rest).max() > 0.2
    entry = bar.arapfields.carried[0]
    assert entry.base and entry.base_kind == {"EMPTY": "TRANSFORM", "ARMATURE": "BONES"}[kind]
    entry.property_unset("base_kind")
    path = f"{tempfile.mkdtemp()}/earlier.blend"
    names = bar.name, item.name
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    bar, item = (bpy.data.objects[name] for name in names)
    scenes.activate(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"}  # goes on from the object's own pose
    bpy.ops.arapfields.live()
    assert bpy.ops.arapfields.release(all=True) == {"FINISHED"}
    assert np.abs(shown(item) - rest).max() < CLOSE


def test_another_way_to_be_carried_spoils_nothing_of_the_others():
    """An armature that follows, then moves as a whole; an Empty and a patch come after it in the list."""
    bar, moving = body()
    items = [rider(kind) for kind in ("ARMATURE", "EMPTY", "MESH")]
    rest = [shown(item) for item in items]
    for item in items:
        scenes.activate(item, bar)
        bpy.ops.arapfields.carry()
    scenes.activate(bar)
    moving.location.z += 0.4
    solves = {
        "deform": lambda: bpy.ops.arapfields.deform(samples=1000),
        "live": lambda: sessions.begin(bpy.context, bar),
    }
    for name, solve in solves.items():
        for way in ("FOLLOW", "RIGID"):
            bar.arapfields.carried[0].way = way
            solve()
            step(refined=True)
            pose = np.array(items[0].pose.bones[0].matrix_basis)
            assert (np.abs(pose - np.eye(4)).max() < CLOSE) == (way == "RIGID"), (name, way)
            for item, before in zip(items, rest, strict=True):
                assert np.abs(shown(item) - before).max() > 0.2, (name, way, item.name)
        if name == "deform":
            assert bpy.ops.arapfields.remove_field() == {"FINISHED"}
    sessions.end(bpy.context, bar)
    for item, before in zip(items, rest, strict=True):
        assert np.abs(shown(item) - before).max() < CLOSE, item.name


# Carried objects of other files, overridden, hidden or lost while live, and what a mask says of them.


def test_what_is_linked_is_named_and_the_rest_goes_on():
    bar, moving = body()
    linked = scenes.from_another_file(rider("MESH"))[0]
    scenes.activate(linked, bar)
    with pytest.raises(RuntimeError, match="Patch is linked from another file; make it local to carry it"):
        bpy.ops.arapfields.carry()
    good = rider("CURVE")
    scenes.activate(linked, good, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    assert [entry.item for entry in bar.arapfields.carried] == [good]
    entry = bar.arapfields.carried.add()  # one that was carried, and is linked now
    entry.name, entry.item = linked.name, linked
    before = shown(good), shown(linked)
    scenes.activate(bar)
    jobs.board.messages.clear()
    bpy.ops.arapfields.live()
    assert "Patch is linked from another file" in "\n".join(text for _, text in jobs.messages())
    moving.location.z += 0.4
    step(refined=True)
    assert np.abs(shown(good) - before[0] - [0, 0, 0.4]).max() < 0.1
    assert np.array_equal(shown(linked), before[1]) and not linked.modifiers
    bpy.ops.arapfields.live()
    bpy.ops.arapfields.release(all=True)


@pytest.mark.parametrize("kind", ["MESH", "EMPTY", "CURVES", "CURVE", "ARMATURE"])
def test_library_overrides_are_carried_or_named(kind):
    """What moves as a whole, a mesh and bones need none of the linked data; other points lie there."""
    bar, moving = body()
    linked = scenes.from_another_file(rider(kind))[0]
    item = linked.override_create(remap_local_usages=True)
    if item.name not in bpy.context.collection.objects:
        bpy.context.collection.objects.link(item)
    bpy.context.view_layer.update()
    before = shown(item)
    scenes.activate(item, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    scenes.activate(bar)
    jobs.board.messages.clear()
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    moving.location.z += 0.4
    step(refined=True)
    assert sessions.is_live(bar)
    messages = "\n".join(text for _, text in jobs.messages())
    if kind in ("CURVES", "CURVE"):
        assert f"{item.name} is linked from another file; make it local to carry it" in messages
        assert np.array_equal(shown(item), before)
    else:
        assert item.name not in messages and np.abs(shown(item) - before - [0, 0, 0.4]).max() < 0.1
    bpy.ops.arapfields.live()
    assert np.abs(shown(item) - before).max() < CLOSE


def test_baked_library_overrides_are_results_like_others():
    """In objects of their own, twice the same one, also after the file was opened again."""
    bar, moving = body()
    linked = scenes.from_another_file(rider("MESH"))[0]
    item = linked.override_create(remap_local_usages=True)
    scenes.activate(item, bar)
    bpy.ops.arapfields.carry(way="FOLLOW")
    moving.location.z += 0.4
    for _ in range(2):
        bar, item = bpy.data.objects["Bar"], next(o for o in bpy.data.objects if o.override_library)
        scenes.activate(bar)
        assert bpy.ops.arapfields.bake(format="KEYS", start=1, end=2) == {"FINISHED"}
        path = f"{tempfile.mkdtemp()}/scene.blend"
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        item = next(o for o in bpy.data.objects if o.override_library)
        baked = [entry.item for entry in item.arapfields.results]
        assert [owner_of(one) for one in baked] == [item] and item.arapfields.set_aside
        assert sum(other.name.startswith(baked[0].name) for other in bpy.data.objects) == 1


def test_one_that_is_hidden_or_deleted_while_live_is_named_and_nothing_of_the_rest_is_lost():
    bar, moving = body()
    items = [rider(kind) for kind in ("MESH", "CURVES", "EMPTY", "LATTICE")]
    bpy.context.view_layer.update()
    rest = [shown(item) for item in items]
    scenes.activate(*items, bar)
    bpy.ops.arapfields.carry()
    scenes.activate(bar)
    jobs.board.messages.clear()
    bpy.ops.arapfields.live()
    moving.location.z += 0.2
    step(refined=True)
    delete(items[1])
    bpy.data.objects.remove(items[3])
    moving.location.z += 0.2
    for _ in range(3):
        step(refined=True)
    assert sessions.is_live(bar)
    messages = "\n".join(text for _, text in jobs.messages())
    assert (
        "Hair, which Bar carries, was deleted" in messages
        and "Cage, which Bar carries, was deleted" in messages
    )
    items[0].hide_set(True)  # it is seen again where the field has it meanwhile
    moving.location.z += 0.1
    step(refined=True)
    items[0].hide_set(False)
    for item, before in ((items[0], rest[0]), (items[2], rest[2])):
        assert np.abs(shown(item) - before - [0, 0, 0.5]).max() < 0.1
    bpy.ops.arapfields.live()
    for item, before in ((items[0], rest[0]), (items[2], rest[2])):
        assert np.abs(shown(item) - before).max() < CLOSE
    for index in reversed(range(4)):
        bar.arapfields.active_carried = index
        bpy.ops.arapfields.release()
    assert not bar.arapfields.carried and not items[0].modifiers


def test_the_influence_mask_counts_where_a_carried_object_has_weights_of_that_name():
    bar, moving = body()
    bar.vertex_groups.new(name="Face").add(list(range(len(bar.data.vertices))), 1.0, "REPLACE")
    items = [rider(kind) for kind in ("MESH", "CURVES", "LATTICE", "CURVE", "EMPTY")]
    patch, hair, cage = items[:3]
    patch.vertex_groups.new(name="Face").add([0, 1], 1.0, "REPLACE")
    cage.vertex_groups.new(name="Face").add(range(4), 1.0, "REPLACE")
    hair.data.attributes.new("Face", "FLOAT", "POINT").data.foreach_set("value", [1, 1, 0, 0])
    bpy.context.view_layer.update()
    rest = [shown(item) for item in items]
    moves = [np.array([1, 1, 0, 0]), np.array([1, 1, 0, 0]), np.r_[np.ones(4), np.zeros(4)], 1, 1]
    scenes.activate(*items, bar)
    bpy.ops.arapfields.carry()
    moving.location.z += 0.4
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    step(refined=True)
    for name in ("Face", "", "Face"):
        bar.arapfields.stiffness.mask = name
        for item, before, share in zip(items, rest, moves, strict=True):
            share = np.broadcast_to(share if name else 1, len(before))
            shifts = shown(item) - before
            assert np.abs(shifts[share == 0]).max(initial=0) < CLOSE, (item.name, name)
            assert np.abs(shifts[share == 1] - [0, 0, 0.4]).max() < 0.15, (item.name, name)
    bpy.ops.arapfields.live()


# Bakes into shape keys of carried meshes that modifiers refine.


def test_hair_and_hooks_are_on_the_baked_object_and_what_is_bound_is_named():
    bar, _, _ = scenes.bar_with_handles()
    sleeve = scenes.bar("Sleeve", 0.6)
    hook, cage = bpy.data.objects.new("Hook", None), scenes.bar("Cage", 0.9)
    cage.scale = (1.0, 2.0, 2.0)
    bpy.context.collection.objects.link(hook)
    scenes.activate(sleeve)
    sleeve.modifiers.new("Finer", "SUBSURF")
    sleeve.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = sleeve.particle_systems[0].settings
    settings.type, settings.count, sleeve.particle_systems[0].seed = "HAIR", 40, 7
    sleeve.modifiers.new("Cloth", "COLLISION")
    sleeve.collision.damping = 0.25
    scenes.activate(sleeve, bar)
    bpy.ops.arapfields.carry()
    bpy.context.scene.frame_set(1)
    bpy.ops.arapfields.deform(**scenes.QUICK)
    hooked, bound = sleeve.modifiers.new("Hook", "HOOK"), sleeve.modifiers.new("Bound", "SURFACE_DEFORM")
    hooked.object, bound.target = hook, cage
    hooked.vertex_indices_set([0, 5, 9])
    last = len(sleeve.modifiers) - 1
    for one in (hooked, bound):  # Blender 5.2 puts a new hook first
        sleeve.modifiers.move(sleeve.modifiers.find(one.name), last)
    bpy.context.view_layer.update()
    scenes.activate(sleeve)
    assert bpy.ops.object.surfacedeform_bind(modifier="Bound") == {"FINISHED"}
    scenes.activate(bar)
    assert bpy.ops.arapfields.bake(format="KEYS", start=1, end=2) == {"FINISHED"}
    baked = bpy.data.objects["Sleeve_baked"]
    behind = [one.name for one in modifier_stack.behind(sleeve)]
    assert behind == ["Finer", "Hair", "Cloth", "Hook", "Bound"]
    assert [one.name for one in baked.modifiers] == behind
    assert list(baked.modifiers["Hook"].vertex_indices) == [0, 5, 9]
    assert ("WARNING", "Bar: Sleeve_baked: bind or comb Bound again") in jobs.messages(), jobs.messages()
    assert baked.collision.damping == 0.25
    (hair,) = baked.particle_systems
    assert (hair.settings, hair.seed) == (settings, 7)


def test_modifiers_behind_the_field_act_on_the_baked_object_too():
    bar, _, moving = scenes.bar_with_handles()
    sleeve = scenes.bar("Sleeve", 0.6)
    laid = sleeve.modifiers.new("Laid", "SHRINKWRAP")
    laid.target, laid.wrap_mode, laid.offset = bar, "OUTSIDE", 0.05
    sleeve.modifiers.new("Finer", "SUBSURF")
    node_group.put(scenes.reading_nodes(sleeve, bar), "Share", 0.25)
    scenes.activate(sleeve, bar)
    bpy.ops.arapfields.carry()
    for frame, height in ((1, 0.0), (3, 0.4)):
        moving.location.z += height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    live = {}
    for frame in (1, 3):
        bpy.context.scene.frame_set(frame)
        step(refined=True)
        step(refined=True)
        live[frame] = scenes.world_points(sleeve)
    bpy.ops.arapfields.live()
    for _ in range(2):
        scenes.activate(bar)
        assert bpy.ops.arapfields.bake(format="KEYS", start=1, end=3) == {"FINISHED"}
        baked = bpy.data.objects["Sleeve_baked"]
        assert [one.type for one in baked.modifiers] == ["SHRINKWRAP", "SUBSURF", "NODES"]
        read = [node_group.get(baked.modifiers["Nodes"], name) for name in ("Goal", "Share")]
        assert read == [bpy.data.objects["Bar_baked"], 0.25]
        for frame, points in live.items():
            bpy.context.scene.frame_set(frame)
            bpy.context.view_layer.update()
            assert np.abs(scenes.world_points(baked) - points).max() < 0.01
