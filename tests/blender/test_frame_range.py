# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames the range *Animation* means: those of all that moves what is baked, however far it is away."""

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.stacks import armature

    from addon.solver.frame_range import animation_range

pytestmark = pytest.mark.in_blender

FIRST, LAST = 3, 33


def keyed(item, path="location"):
    """Two keyframes of an item."""
    for frame in (FIRST, LAST):
        item.keyframe_insert(path, frame=frame)
    return item


def empty(name="Control"):
    item = bpy.data.objects.new(name, None)
    bpy.context.collection.objects.link(item)
    return item


def driven(owner, path, target, read, *index):
    variable = owner.driver_add(path, *index).driver.variables.new()
    variable.targets[0].id_type = target.id_type
    variable.targets[0].id, variable.targets[0].data_path = target, read


def by_a_bones_goal(bar, _):
    rig = armature()
    rig.pose.bones["Second"].constraints.new("IK").target = keyed(empty())
    bar.modifiers.new("Rig", "ARMATURE").object = rig


def by_a_driven_key(bar, _):
    bar.shape_key_add(name="Basis")
    driven(bar.shape_key_add(name="Wide"), "value", keyed(empty()), "location.x")


def by_another_objects_key(bar, moving):
    other = scenes.bar("Other")
    other.shape_key_add(name="Basis")
    key = other.shape_key_add(name="Wide")
    keyed(key, "value")
    driven(moving, "location", other.data.shape_keys, 'key_blocks["Wide"].value', 2)


def by_an_armature_constraint(bar, moving):
    target = moving.constraints.new("ARMATURE").targets.new()
    target.target, target.subtarget = armature(), "Bone"
    keyed(target.target.pose.bones["Bone"])


def by_a_path(bar, moving):
    curve = bpy.data.curves.new("Path", "CURVE")
    path = bpy.data.objects.new("Path", curve)
    bpy.context.collection.objects.link(path)
    moving.constraints.new("FOLLOW_PATH").target = path
    keyed(curve, "eval_time")


def by_an_object_of_nodes(bar, _):
    scenes.reading_nodes(bar, keyed(empty()))


def by_an_obstacle(bar, _):
    bar.arapfields.contact.use = True
    bar.arapfields.contact.obstacle_list.add().item = keyed(scenes.bar("Obstacle"))


BY = (by_a_bones_goal, by_a_driven_key, by_another_objects_key, by_an_armature_constraint, by_a_path)
BY += (by_an_object_of_nodes, by_an_obstacle)


@pytest.mark.parametrize("by", [one.__name__ for one in BY])
def test_what_moves_the_shape_from_afar_counts(by):
    bar, _, moving = scenes.bar_with_handles()
    assert animation_range(bar, "DEFORM") is None
    globals()[by](bar, moving)
    assert animation_range(bar, "DEFORM") == (FIRST, LAST)
