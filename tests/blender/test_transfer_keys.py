# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of shape keys that a wrapped object hands on to its target."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.wraps import SMALL, bar_and_target, offsets, rigged_bar, soup_of

    from addon.blender import mesh_arrays

pytestmark = pytest.mark.in_blender

SINGLE = 1e-5  # Blender keeps coordinates in single precision


def shifted(item, name, by):
    """A further shape key that shifts every vertex."""
    block = item.shape_key_add(name=name, from_mix=False)
    points = mesh_arrays.vectors(block.data, "co")
    mesh_arrays.put_vectors(block.data, points + np.array(by), "co")
    return block


def test_values_that_the_wrap_was_made_with_do_not_move_the_target():
    """The wrap lays what is seen onto the target, keys included: a further key takes their values back."""
    item, target = bar_and_target()
    item.shape_key_add(name="Basis")
    fat, unseen = shifted(item, "Fat", (0, 0, 0)), shifted(item, "Unseen", (0, 0, 2))
    for point in fat.data:
        point.co.y *= 1.5
    half, tip = shifted(item, "Half", (0.2, 0, 0)), shifted(item, "Tip", (0, 0.4, 0))
    half.relative_key = fat
    tip.vertex_group = item.vertex_groups.new(name="End").name
    item.vertex_groups["End"].add([v.index for v in item.data.vertices if v.co.x > 0], 0.5, "REPLACE")
    unseen.value, unseen.mute = 1.0, True
    half.value, tip.slider_min, tip.value = 0.5, -1.0, -0.3
    item["smile"] = 0.6
    driver = fat.driver_add("value").driver
    variable = driver.variables.new()
    variable.name, variable.targets[0].id, variable.targets[0].data_path = "smile", item, '["smile"]'
    driver.expression = "smile"
    target["smile"] = 0.6
    bpy.context.view_layer.update()
    scenes.activate(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    shown, own = scenes.world_points(target), mesh_arrays.positions(target.data)
    scenes.activate(item)
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    bpy.context.view_layer.update()
    keys = target.data.shape_keys.key_blocks
    assert [key.name for key in keys] == ["Basis", "Fat", "Unseen", "Half", "Tip", "ARAP Neutral"]
    assert [round(key.value, 5) for key in keys[1:]] == [0.6, 1.0, 0.5, -0.3, 1.0]
    assert keys["Unseen"].mute and keys["Half"].relative_key == keys["Fat"]
    assert np.array_equal(mesh_arrays.positions(target.data), own)
    assert np.abs(scenes.world_points(target) - shown).max() < SINGLE
    offset = offsets(target, "Fat") @ np.array(target.matrix_world)[:3, :3].T
    target["smile"] = 1.0
    target.update_tag()
    bpy.context.view_layer.update()
    assert np.abs(offset).max() > 0.1
    assert np.abs(scenes.world_points(target) - shown - 0.4 * offset).max() < 2 * SINGLE

    item["smile"], tip.value = 0.2, 0.0  # since the wrap: the target looks as the object does
    item.update_tag()
    bpy.context.view_layer.update()
    target["smile"] = 0.2
    scenes.activate(item)
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    bpy.context.view_layer.update()
    weights = [
        [g.weight for g in v.groups if g.group == target.vertex_groups["End"].index]
        for v in target.data.vertices
    ]
    masked = np.array([[sum(each)] for each in weights]) * offsets(target, "Tip")
    change = (0.3 * masked - 0.4 * offsets(target, "Fat")) @ np.array(target.matrix_world)[:3, :3].T
    assert len(keys) == 6 and np.abs(masked).max() > 0.1
    assert np.abs(scenes.world_points(target) - shown - change).max() < 2 * SINGLE


def test_undo_and_a_wrap_at_rest_take_the_neutral_key_away():
    item, target = bar_and_target()
    item.shape_key_add(name="Basis")
    shifted(item, "Up", (0, 0, 0.2)).value = 0.5
    scenes.activate(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    bpy.context.preferences.edit.use_global_undo = True
    names = item.name, target.name
    for message in ("Wrap", "Transfer"):
        bpy.ops.ed.undo_push(message=message)
        if message == "Wrap":
            assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    bpy.ops.ed.undo()
    assert bpy.data.objects[names[1]].data.shape_keys is None
    bpy.ops.ed.redo()
    item, target = (bpy.data.objects[name] for name in names)
    assert "ARAP Neutral" in target.data.shape_keys.key_blocks
    item.data.shape_keys.key_blocks["Up"].value = 0.0
    scenes.activate(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    assert [(key.name, key.value) for key in target.data.shape_keys.key_blocks[1:]] == [("Up", 0.0)]


def test_keys_that_are_relative_to_each_other_in_a_circle_are_carried():
    item, target = bar_and_target()
    item.shape_key_add(name="Basis")
    one, other, own = (shifted(item, name, (0, 0, 0.2)) for name in ("One", "Other", "Own"))
    one.relative_key, other.relative_key, own.relative_key = other, one, own
    one.value = other.value = own.value = 0.0
    scenes.activate(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    scenes.activate(item)
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    keys = target.data.shape_keys.key_blocks
    assert [key.relative_key.name for key in keys] == ["Basis", "Other", "One", "Own"]
    for key in keys[1:]:
        moved = mesh_arrays.vectors(key.data, "co") - mesh_arrays.vectors(keys[0].data, "co")
        assert 0.1 < np.abs(moved).max() < 0.4


def test_a_target_whose_keys_are_absolute_is_refused():
    item, target = bar_and_target()
    item.shape_key_add(name="Basis")
    shifted(item, "Up", (0, 0, 0.2))
    target.shape_key_add(name="Basis")
    shifted(target, "Own", (0, 0, 0.2))
    target.data.shape_keys.use_relative = False
    scenes.activate(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    scenes.activate(item)
    with pytest.raises(RuntimeError, match="The shape keys of Scan are absolute"):
        bpy.ops.arapfields.transfer()
    assert [key.name for key in target.data.shape_keys.key_blocks] == ["Basis", "Own"]


def test_a_locked_key_of_the_target_stays_as_it_was_sculpted():
    item, target = bar_and_target()
    item.shape_key_add(name="Basis")
    shifted(item, "Up", (0, 0, 0.2))
    above = shifted(item, "Above", (0, 0, 0.1))
    above.relative_key = item.data.shape_keys.key_blocks["Up"]
    scenes.activate(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    scenes.activate(item)
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    offset = offsets(target, "Above")
    up = target.data.shape_keys.key_blocks["Up"]
    sculpted = mesh_arrays.vectors(up.data, "co") + np.array([0, 0.5, 0])
    mesh_arrays.put_vectors(up.data, sculpted, "co")
    up.lock_shape = True
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    assert np.array_equal(mesh_arrays.vectors(up.data, "co"), sculpted.astype(np.float32))
    assert np.abs(offsets(target, "Above") - offset).max() < SINGLE


def driven(item, name, read, path):
    """A key that a property moves, by a driver."""
    block = shifted(item, name, (0, 0, 0.1))
    driver = block.driver_add("value").driver
    driver.expression = "var"
    variable = driver.variables.new()
    variable.targets[0].id_type = read.id_type
    variable.targets[0].id, variable.targets[0].data_path = read, path


def test_drivers_read_properties_of_the_target_and_its_armature():
    item, rig = rigged_bar()
    item["fat"], item.data["thin"], rig["arm"], rig.data["leg"] = 0.5, 0.25, 0.125, 0.75
    item.id_properties_ui("fat").update(max=3.0)
    for read, name in ((item, "fat"), (item.data, "thin"), (rig, "arm"), (rig.data, "leg")):
        driven(item, name, read, f'["{name}"]')
    driven(item, "place", item, "location.x")
    target = item.arapfields.wrap.onto = soup_of(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    twin = bpy.data.objects["Rig Soup"]
    target["fat"], target.data["thin"], twin["arm"], twin.data["leg"] = 0.1, 0.2, 0.3, 0.4
    assert target.id_properties_ui("fat").as_dict()["max"] == 3.0
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}  # again: the target's own values stay
    for one in (target, target.data, twin, twin.data):
        one.update_tag()
    bpy.context.view_layer.update()
    values = {block.name: block.value for block in target.data.shape_keys.key_blocks}
    wanted = {"fat": 0.1, "thin": 0.2, "arm": 0.3, "leg": 0.4, "place": 0.0}
    assert {name: values[name] for name in wanted} == pytest.approx(wanted)
    curves = item.data.shape_keys.animation_data.drivers
    assert {one.driver.variables[0].targets[0].id for one in curves} == {item, item.data, rig, rig.data}
