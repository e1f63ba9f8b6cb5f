# SPDX-License-Identifier: GPL-3.0-or-later
"""What a wrapped object has, handed on to its target inside Blender."""

import json

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.wraps import SMALL, offsets, rigged_bar, soup_of

    import arapfields as af
    from addon.blender import mesh_arrays, vertex_groups
    from addon.carried import rest_bones
    from addon.field_modifier import motion

pytestmark = pytest.mark.in_blender

SINGLE = 1e-5  # Blender keeps coordinates in single precision
TURN = np.array([[0.0, -1.4, 0.0], [1.4, 0.0, 0.0], [0.0, 0.0, 1.4]])


def wrapped_bar():
    """A decorated, rigged bar, turned and scaled onto a copy of its mesh whose vertices come in reverse."""
    item, rig = rigged_bar()
    rig.arapfields.rest_bones = json.dumps(rest_bones.rest_of(rig))
    mesh = item.data
    rest = mesh_arrays.positions(mesh)
    colour = mesh.attributes.new("Paint", "FLOAT_COLOR", "CORNER")
    corners = mesh_arrays.corner_vertices(mesh)
    colour.data.foreach_set("color", np.c_[rest[corners], np.ones(len(corners))].astype(np.float32).ravel())
    fat = mesh.shape_keys.key_blocks["Fat"]
    fat.value, fat.slider_max = 0.25, 2.0
    driver = fat.driver_add("value").driver
    driver.type, driver.expression = "SCRIPTED", "frame / 100"
    belly = item.shape_key_add(name="Belly", from_mix=False)
    belly.relative_key, belly.mute = fat, True
    faces = [[len(rest) - 1 - v for v in face.vertices] for face in mesh.polygons]
    copied = bpy.data.meshes.new("Other")
    copied.from_pydata((rest @ TURN.T + [3, 0, 1])[::-1].tolist(), [], faces)
    target = bpy.data.objects.new("Other", copied)
    bpy.context.collection.objects.link(target)
    item.arapfields.wrap.onto = target
    item.arapfields.under_rig = True
    motion.bind(bpy.context, item)
    fat.driver_remove("value")
    fat.value = 0.0
    fat.driver_add("value").driver.expression = "0 * frame"
    motion.write(item, motion.Motion(rest @ TURN.T + [3, 0, 1] - rest))
    bpy.context.view_layer.update()
    scenes.activate(item)
    return item, target, rest


def test_all_that_an_object_has_comes_along():
    item, target, rest = wrapped_bar()
    own = mesh_arrays.positions(target.data)
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    for name in ("Fat", "Belly"):
        assert np.abs(offsets(target, name) - offsets(item, name)[::-1] @ TURN.T).max() < SINGLE
    fat, belly = (target.data.shape_keys.key_blocks[name] for name in ("Fat", "Belly"))
    assert fat.slider_max == 2.0 and belly.mute and belly.relative_key == fat
    assert target.data.shape_keys.animation_data.drivers[0].driver.expression == "0 * frame"
    assert np.abs(mesh_arrays.positions(target.data) - own).max() == 0
    for group in item.vertex_groups:
        there = target.vertex_groups[group.name]
        for vertex in range(0, len(rest), 7):
            given = {g.group: g.weight for g in item.data.vertices[vertex].groups}.get(group.index, 0.0)
            got = {g.group: g.weight for g in target.data.vertices[len(rest) - 1 - vertex].groups}
            assert abs(got.get(there.index, 0.0) - given) < 2 * SINGLE
    paint = target.data.attributes["Paint"]
    colours = np.empty(len(paint.data) * 4, np.float32)
    paint.data.foreach_get("color", colours)
    at = mesh_arrays.corner_vertices(target.data)
    assert np.abs(colours.reshape(-1, 4)[:, :3] - rest[::-1][at]).max() < SINGLE * 10
    (modifier,) = (m for m in target.modifiers if m.type == "ARMATURE")
    (rig,) = (m.object for m in item.modifiers if m.type == "ARMATURE")
    assert modifier.object != rig and modifier.object.data != rig.data
    assert [bone.name for bone in modifier.object.data.bones] == [bone.name for bone in rig.data.bones]
    assert rest_bones.fitted(item) == [rig] and not rest_bones.fitted(target)  # nothing to reset there

    def counts():
        return len(target.vertex_groups), len(target.data.shape_keys.key_blocks), len(bpy.data.objects)

    before = counts()
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}  # again: nothing comes twice
    assert counts() == before


def test_edges_and_uv_maps_come_where_asked():
    item, target, rest = wrapped_bar()
    mesh, other = item.data, target.data
    pairs = [frozenset(edge.vertices) for edge in mesh.edges]
    seams = {pairs[k] for k in range(0, len(pairs), 5)}
    for edge, pair in zip(mesh.edges, pairs, strict=True):
        edge.use_seam = pair in seams
        edge.use_edge_sharp = False
    crease = mesh.attributes.new("crease_edge", "FLOAT", "EDGE")
    crease.data.foreach_set("value", np.linspace(0, 1, len(pairs), dtype=np.float32))
    layer, corners = mesh.uv_layers[0], mesh_arrays.corner_vertices(mesh)
    name, faces = layer.name, np.repeat(np.arange(len(mesh.polygons)), [p.loop_total for p in mesh.polygons])
    islands = (faces % 3)[:, None] * [10.0, 0.0] + rest[corners][:, :2] + rest[corners][:, 2:] * [0.3, 0.7]
    layer.uv.foreach_set("vector", islands.astype(np.float32).ravel())
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.transfer() == {"FINISHED"}
    last = len(rest) - 1
    back = [frozenset(last - v for v in edge.vertices) for edge in other.edges]
    assert {pair for edge, pair in zip(other.edges, back, strict=True) if edge.use_seam} == seams
    given = dict(zip(pairs, np.linspace(0, 1, len(pairs)), strict=True))
    got = other.attributes["crease_edge"].data
    assert max(abs(got[k].value - given[pair]) for k, pair in enumerate(back)) < SINGLE
    assert not other.uv_layers
    assert bpy.ops.arapfields.transfer(transfer={"UV_MAPS"}) == {"FINISHED"}
    found = np.empty(2 * len(other.loops), np.float32)
    other.uv_layers[name].uv.foreach_get("vector", found)
    assert np.abs(found.reshape(-1, 2) - islands).max() < SINGLE * 100  # each face its own island


def test_only_what_is_chosen_and_no_locked_group():
    item, target, _ = wrapped_bar()
    group = target.vertex_groups.new(name=item.vertex_groups[0].name)
    group.add([0], 0.5, "REPLACE")
    group.lock_weight = True
    assert bpy.ops.arapfields.transfer(transfer={"GROUPS"}) == {"FINISHED"}
    assert target.data.shape_keys is None and not target.modifiers
    assert [round(g.weight, 3) for g in target.data.vertices[0].groups if g.group == 0] == [0.5]
    assert not [v for v in target.data.vertices if v.index and 0 in [g.group for g in v.groups]]


def test_a_rig_whose_bones_were_reset_is_left_out():
    _, target, _ = wrapped_bar()
    assert bpy.ops.arapfields.reset_bones() == {"FINISHED"}
    assert bpy.ops.arapfields.transfer(transfer={"ARMATURE"}) == {"FINISHED"}
    assert not target.modifiers and len(bpy.data.armatures) == 1


def test_what_cannot_take_anything_is_named_and_kept():
    item, target, _ = wrapped_bar()
    kept = scenes.everything(target)
    modifier = item.modifiers.new("Two", "MIRROR")
    item.modifiers.move(len(item.modifiers) - 1, 0)
    with pytest.raises(RuntimeError, match="Modifiers of Bar"):
        bpy.ops.arapfields.transfer()
    item.modifiers.remove(modifier)
    with pytest.raises(RuntimeError, match="no object Gone"):
        bpy.ops.arapfields.transfer(onto="Gone")
    motion.remove(item)
    with pytest.raises(RuntimeError, match="Wrap Bar first"):
        bpy.ops.arapfields.transfer()
    assert scenes.everything(target) == kept


def test_drivers_and_what_is_carried_go_to_the_target():
    item, target, rest = wrapped_bar()
    (rig,) = (m.object for m in item.modifiers if m.type == "ARMATURE")
    keys = item.data.shape_keys
    driver = keys.key_blocks["Belly"].driver_add("value").driver
    driver.expression = "0 * var"
    driver.variables.new().targets[0].id = rig
    shell = bpy.data.meshes.new("Shell")
    outside = rest * (1 + 0.1 / np.linalg.norm(rest, axis=1, keepdims=True))
    shell.from_pydata(outside.tolist(), [], [list(face.vertices) for face in item.data.polygons])
    worn = bpy.data.objects.new("Shell", shell)
    bpy.context.collection.objects.link(worn)
    entry = item.arapfields.carried.add()
    entry.item, entry.way = worn, "FOLLOW"
    motion.bind(bpy.context, worn)
    motion.write(worn, motion.Motion(outside @ TURN.T + [3, 0, 1] - outside))
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.transfer(transfer={"KEYS", "ARMATURE", "CARRIED"}) == {"FINISHED"}
    (mine,) = (m.object for m in target.modifiers if m.type == "ARMATURE")
    copied = target.data.shape_keys.animation_data.drivers
    (read,) = (v.targets[0].id for curve in copied for v in curve.driver.variables)
    assert read == mine != rig
    (own,) = target.children
    places = np.array([own.matrix_world @ v.co for v in own.data.vertices])
    away = af.MeshSdf(mesh_arrays.positions(target.data), mesh_arrays.triangles(target.data))(places)
    before = af.MeshSdf(rest, mesh_arrays.triangles(item.data))(outside)
    assert np.abs(away - 1.4 * before).max() < 0.15 * 1.4 * before.max()  # smoothed at edges
    assert away.min() > 0 and not own.modifiers
    assert bpy.ops.arapfields.transfer() == {"FINISHED"} and len(target.children) == 1


def test_clothes_of_a_wrapped_shape_are_posed_with_it():
    item, rig = rigged_bar()
    worn = item.copy()
    worn.data = item.data.copy()
    worn.shape_key_clear()
    bpy.context.collection.objects.link(worn)
    mesh_arrays.set_positions(worn.data, mesh_arrays.positions(item.data) * [1.0, 1.2, 1.2])
    entry = item.arapfields.carried.add()
    entry.item, entry.way = worn, "FOLLOW"
    item.arapfields.wrap.onto = soup_of(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}

    def away():
        body = af.MeshSdf(scenes.world_points(item), mesh_arrays.triangles(item.data))
        return np.abs(body(scenes.world_points(worn))).max()

    before = away()
    rig.pose.bones["Upper"].rotation_mode, rig.pose.bones["Upper"].rotation_euler.x = "XYZ", 0.8
    assert away() < 2 * before
    assert [m.type for m in worn.modifiers] == ["NODES", "ARMATURE"]


def weights_of(item, name):
    indices = {name: item.vertex_groups[name].index}
    return vertex_groups.weights_in(item.data, indices)[name]


def test_single_groups_mix_with_what_the_target_has():
    item, target, _ = wrapped_bar()
    item.vertex_groups.new(name="Left, Arm").add(range(40), 0.25, "REPLACE")
    count = len(target.data.vertices)
    target.vertex_groups.new(name="Upper").add(range(count), 0.5, "REPLACE")
    target.vertex_groups.new(name="Lower").add(range(count), 0.125, "REPLACE")
    upper, lower = (weights_of(item, name)[::-1] for name in ("Upper", "Lower"))
    only = {"transfer": {"GROUPS"}}
    assert bpy.ops.arapfields.transfer(**only, groups="Upper", mix=0.25) == {"FINISHED"}
    assert np.abs(weights_of(target, "Upper") - 0.25 * upper - 0.75 * 0.5).max() < 2 * SINGLE
    assert sorted(group.name for group in target.vertex_groups) == ["Lower", "Upper"]
    assert np.abs(weights_of(target, "Lower") - 0.125).max() == 0
    assert bpy.ops.arapfields.transfer(**only, groups="Left, Arm", mix=0.5) == {"FINISHED"}
    assert (
        np.abs(weights_of(target, "Left, Arm") - 0.5 * weights_of(item, "Left, Arm")[::-1]).max() < 2 * SINGLE
    )
    item.arapfields.wrap.groups, item.arapfields.wrap.mix = "Lower, Upper", 1.0
    assert bpy.ops.arapfields.transfer(**only) == {"FINISHED"}
    for name, wanted in (("Upper", upper), ("Lower", lower)):
        assert np.abs(weights_of(target, name) - wanted).max() < 2 * SINGLE
    with pytest.raises(RuntimeError, match="Bar has no vertex group Tail"):
        bpy.ops.arapfields.transfer(**only, groups="Upper, Tail")
