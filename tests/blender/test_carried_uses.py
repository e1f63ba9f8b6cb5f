# SPDX-License-Identifier: GPL-3.0-or-later
"""Carried objects that are edited, lost or refused, that share an armature, and bakes."""

import tempfile

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Vector
    from support.blender import scenes, wraps
    from support.blender.bones import rigged_bar
    from support.blender.live import step
    from support.blender.riders import body, link, rider, shown, taken

    from addon.core.runtime import jobs
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

CLOSE = 1e-5  # single precision of positions of size one
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
