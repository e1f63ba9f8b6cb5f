# SPDX-License-Identifier: GPL-3.0-or-later
"""What a wrapped character carries, handed on to its target, which has an armature of its own then."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Vector
    from support.blender import scenes, wraps
    from support.blender.character import link
    from support.blender.stages import all_said

    from addon.blender.actions import curves_of
    from addon.field_modifier import inputs

pytestmark = pytest.mark.in_blender


def ball(name, at):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=8, ring_count=6, radius=0.05, location=at)
    bpy.context.object.name = name
    return bpy.context.object


def hung_on(rig, item, parent):
    """Makes it a child of a bone, or of what hangs on one, where it is."""
    bpy.context.view_layer.update()
    world = item.matrix_world.copy()
    item.parent, item.parent_type, item.parent_bone = parent, "BONE" if parent == rig else "OBJECT", "Upper"
    bpy.context.view_layer.update()
    item.matrix_world = world


def copies():
    return {item["arapfields_copy_of"]: item for item in bpy.data.objects if "arapfields_copy_of" in item}


def places(items):
    bpy.context.view_layer.update()
    return {name: scenes.world_points(item).mean(axis=0) for name, item in items.items()}


@pytest.mark.parametrize("way", ["FOLLOW", "RIGID"])
def test_eyes_on_a_bone_hang_on_the_same_bone_of_the_targets_armature(way):
    item, rig = wraps.rigged_bar()
    item.arapfields.wrap.onto = wraps.soup_of(item)
    spot = link("Spot", None)
    eyes = ball("Eye", (0.6, -0.3, 0.1)), ball("Other", (0.6, -0.3, 0.25))
    hung_on(rig, spot, rig)
    for eye, parent in zip(eyes, (rig, spot), strict=True):
        hung_on(rig, eye, parent)
    scenes.activate(*eyes, item)
    bpy.ops.arapfields.carry(way=way)
    upper = rig.pose.bones["Upper"]
    upper.rotation_mode, upper.rotation_euler.x = "XYZ", 0.3
    assert bpy.ops.arapfields.wrap(**wraps.SMALL) == {"FINISHED"}
    for _ in range(2):
        assert bpy.ops.arapfields.transfer() == {"FINISHED"}
        twin = bpy.data.objects["Rig Soup"]
        assert sorted(copies()) == ["Eye", "Other"]
        for angle in (0.3, 0.0, -0.6):
            for one in (rig, twin):
                one.pose.bones["Upper"].rotation_euler.x = angle
            mine, theirs = places({eye.name: eye for eye in eyes}), places(copies())
            for name, place in mine.items():
                assert np.linalg.norm(theirs[name] - place) < 0.03, (name, angle, theirs[name] - place)


def test_modifiers_and_constraints_of_copies_read_what_the_target_has():
    item, rig = wraps.rigged_bar()
    target = wraps.soup_of(item)
    item.arapfields.wrap.onto = target
    eye, spot = ball("Eye", (0.6, -0.3, 0.1)), link("Spot", None)
    spot.location = Vector((0.6, -2, 0.1))
    away = eye.modifiers.new("Near", "VERTEX_WEIGHT_PROXIMITY")
    away.target = item
    sees, bone = eye.constraints.new("DAMPED_TRACK"), eye.constraints.new("LIMIT_DISTANCE")
    sees.target, bone.target, bone.subtarget = spot, rig, "Upper"
    bone.distance = 20.0
    scenes.activate(eye, spot, item)
    bpy.ops.arapfields.carry()
    assert bpy.ops.arapfields.wrap(**wraps.SMALL) == {"FINISHED"}
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    made = copies()["Eye"]
    assert made.modifiers["Near"].target == target
    assert [one.target for one in made.constraints] == [copies()["Spot"], bpy.data.objects["Rig Soup"]]
    assert away.target == item and [one.target for one in eye.constraints] == [spot, rig]


def test_nodes_drivers_and_bones_of_copies_read_what_the_target_has():
    item, rig = wraps.rigged_bar()
    target = wraps.soup_of(item)
    item.arapfields.wrap.onto = target
    rig.data["leg"] = 0.5
    rig.pose.bones["Upper"].constraints.new("DAMPED_TRACK").target = item
    eye = ball("Eye", (0.6, -0.3, 0.1))
    eye.shape_key_add(name="Basis")
    scenes.reading_nodes(eye, item)
    for owner, path, block, value in (
        (eye.shape_key_add(name="Up"), "value", item.data.shape_keys, 'key_blocks["Fat"].value'),
        (rig, "empty_display_size", rig.data, '["leg"]'),
    ):
        variable = owner.driver_add(path).driver.variables.new()
        variable.targets[0].id_type = block.id_type
        variable.targets[0].id, variable.targets[0].data_path = block, value
    scenes.activate(eye, item)
    bpy.ops.arapfields.carry(way="RIGID")
    assert bpy.ops.arapfields.wrap(**wraps.SMALL) == {"FINISHED"}
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}

    def read_by(eye, rig):
        owners = eye.data.shape_keys, rig
        driven = [one.animation_data.drivers[0].driver.variables[0].targets[0].id for one in owners]
        tracked = rig.pose.bones["Upper"].constraints[0].target
        return [*driven, tracked, inputs.get(eye.modifiers["Nodes"], "Goal")]

    twin = bpy.data.objects["Rig Soup"]
    assert read_by(eye, rig) == [item.data.shape_keys, rig.data, item, item]
    assert read_by(copies()["Eye"], twin) == [target.data.shape_keys, twin.data, target, target]


@pytest.mark.parametrize("way", ["FOLLOW", "RIGID"])
def test_what_a_constraint_ties_to_a_fitted_armature_is_not_moved_twice(way):
    item, rig = wraps.rigged_bar()
    item.arapfields.wrap.onto = wraps.soup_of(item)
    eye, other = ball("Eye", (0.6, -0.3, 0.1)), ball("Other", (0.6, -0.3, 0.1))
    tie = eye.constraints.new("CHILD_OF")
    tie.target, tie.subtarget = rig, "Upper"
    tie.inverse_matrix = (rig.matrix_world @ rig.pose.bones["Upper"].matrix).inverted()
    scenes.activate(eye, other, item)
    bpy.ops.arapfields.carry(way=way)
    assert bpy.ops.arapfields.wrap(**wraps.SMALL) == {"FINISHED"}
    assert "Eye follows the armature by a constraint; it is not carried" in all_said()
    own = places({one.name: one for one in (eye, other)})
    assert np.linalg.norm(own["Eye"] - own["Other"]) < 0.3  # as the bone goes, which is as the field goes
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    assert "Carried Objects: 1, Eye follows the armature by a constraint" in all_said()
    assert list(copies()) == ["Other"]


def test_copies_have_actions_of_their_own_that_do_not_put_them_back():
    item, rig = wraps.rigged_bar()
    item.arapfields.wrap.onto = wraps.soup_of(item)
    eye = ball("Eye", (0.6, -0.3, 0.1))
    eye["blink"] = 0.0
    bone = rig.pose.bones["Upper"]
    bone.rotation_mode = "XYZ"
    for frame, turn in ((1, 0.0), (5, 0.4)):
        eye["blink"], bone.rotation_euler.x = turn, turn
        eye.keyframe_insert("location", frame=frame)
        eye.keyframe_insert('["blink"]', frame=frame)
        bone.keyframe_insert("rotation_euler", frame=frame)
    scenes.activate(eye, item)
    bpy.ops.arapfields.carry(way="RIGID")
    assert bpy.ops.arapfields.wrap(**wraps.SMALL) == {"FINISHED"}
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    twin, copied = bpy.data.objects["Rig Soup"], copies()["Eye"]
    place = places(copies())["Eye"]
    bpy.context.scene.frame_set(5)
    assert np.abs(places(copies())["Eye"] - place).max() < 1e-5
    assert copied["blink"] == pytest.approx(0.4) and eye["blink"] == pytest.approx(0.4)
    assert twin.pose.bones["Upper"].rotation_euler.x == pytest.approx(0.4)
    twin.pose.bones["Upper"].rotation_euler.x = 1.0
    twin.pose.bones["Upper"].keyframe_insert("rotation_euler", frame=5)
    bpy.context.scene.frame_set(1)
    bpy.context.scene.frame_set(5)
    assert bone.rotation_euler.x == pytest.approx(0.4)
    assert "location" in [one.data_path for one in curves_of(eye.animation_data.action)]
