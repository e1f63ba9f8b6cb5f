# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that users delete, duplicate, override or edit at the wrong moment."""

import tempfile

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import animated
    from support.blender.bones import rigged_bar
    from support.blender.scenes import delete

    from addon.blender.object_references import source_of
    from addon.carried import operators as carried
    from addon.handles import empties, operators

pytestmark = pytest.mark.in_blender


def test_a_deleted_empty_is_no_handle_though_a_pointer_keeps_it():
    bar, fixed, moving = scenes.bar_with_handles()
    delete(moving)
    assert [entry.empty for entry in empties.used(bar)] == [fixed]
    delete(fixed)
    with pytest.raises(RuntimeError, match="Drag a pin or add a handle first"):
        bpy.ops.arapfields.deform(**scenes.NEW)


def test_a_deleted_source_is_worked_on_no_more():
    bar, fixed, _ = scenes.bar_with_handles()
    bpy.ops.arapfields.deform(**scenes.NEW)
    result = bpy.data.objects["Bar_deformed"]
    delete(bar)
    scenes.activate(fixed)
    assert source_of(bpy.context) is None and not bpy.ops.arapfields.deform.poll()
    assert fixed.arapfields.owner == fixed.arapfields
    scenes.activate(result)
    assert source_of(bpy.context) == result  # an object like any other


def test_a_copy_of_a_handle_takes_no_other_handle_away():
    bar, fixed, moving = scenes.bar_with_handles()
    copied = moving.copy()
    bpy.context.collection.objects.link(copied)
    bpy.context.view_layer.update()
    scenes.activate(copied)
    with pytest.raises(RuntimeError, match=r"Moving\.001 is a copy of a handle and is none itself"):
        bpy.ops.arapfields.remove_handle()
    assert len(bar.arapfields.handles) == 2
    other = scenes.bar("Other")
    scenes.activate(copied, other)
    bpy.ops.arapfields.add_handle()
    assert [entry.empty for entry in other.arapfields.handles] == [copied]
    assert [entry.empty for entry in bar.arapfields.handles] == [fixed, moving]


def test_taking_a_handle_from_another_mesh_is_said():
    bar, _, moving = scenes.bar_with_handles()
    other = scenes.bar("Other")
    scenes.activate(moving, other)
    said = reports(operators.ARAPFIELDS_OT_add_handle, kind="CUBE", place="AUTO", group="")
    assert said["WARNING"][0] == "Handles of Bar were taken over by Other"
    assert len(bar.arapfields.handles) == 1 and len(other.arapfields.handles) == 1


def test_a_handle_that_holds_nothing_is_said():
    bar = scenes.bar()
    far = scenes.cube_empty((30, 0, 0), (1, 1, 1), "Far")
    scenes.activate(far, bar)
    said = reports(operators.ARAPFIELDS_OT_add_handle, kind="CUBE", place="AUTO", group="")
    assert said["WARNING"] == ["No part of the surface lies in the rest region of Far"]


def test_meshes_with_bones_of_their_own_are_said():
    """A figure of several objects: the body alone has handles, and a sleeve's bone moves nothing."""
    bar, rig = rigged_bar()
    bar.vertex_groups.remove(bar.vertex_groups["Second"])
    shirt, sleeve = scenes.bar("Shirt"), scenes.bar("Sleeve")
    for item, bone in ((shirt, "Bone"), (sleeve, "Second")):
        item.vertex_groups.new(name=bone).add(range(len(item.data.vertices)), 1.0, "REPLACE")
        item.modifiers.new("Armature", "ARMATURE").object = rig
    scenes.activate(shirt, sleeve, bar)
    said = reports(carried.ARAPFIELDS_OT_carry, way="FOLLOW")
    assert not said["WARNING"]
    scenes.activate(rig, bar)
    line = "Bones that Bar has no vertex groups of do not pose Sleeve; join these with it first (Ctrl J)"
    for name in ("AUTO", "DEFORMING"):
        assert reports(operators.ARAPFIELDS_OT_add_bones, bones=name)["WARNING"] == [line]
    scenes.activate(sleeve, bar)
    assert reports(carried.ARAPFIELDS_OT_carry, way="TOGETHER")["WARNING"] == [line]
    assert not reports(carried.ARAPFIELDS_OT_carry, way="RIGID")["WARNING"]


def reports(operator, **properties):
    """{level: texts} that an operator reports when it is executed with these properties."""
    said = {"INFO": [], "WARNING": [], "ERROR": []}
    stand_in = type("Operator", (), {**vars(operator), **properties})
    for base in reversed([base for base in operator.__mro__[1:] if base.__module__.startswith("addon")]):
        for name, value in vars(base).items():
            if not name.startswith("__") and name not in vars(operator):
                setattr(stand_in, name, value)
    stand_in.report = lambda self, levels, text: said[next(iter(levels))].append(text)
    stand_in().execute(bpy.context)
    return said


def test_nothing_is_changed_on_a_linked_object():
    """Where Blender would show it until the file is opened again."""
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.wrap.onto = scenes.bar("Scan")
    scenes.activate(bar)
    bpy.ops.arapfields.add_landmark(rest=(1, 0, 0), on_target=(1, 0, 0))
    moving.location.z += 0.4
    bpy.ops.arapfields.deform(**scenes.QUICK)
    bar.name = "Linked"
    linked = scenes.from_another_file(bar)[0]
    scenes.activate(linked)
    ours = bpy.ops.arapfields
    for operator in (
        ours.add_handle,
        ours.set_rest,
        ours.remove_handle,
        ours.add_landmark,
        ours.mirror_landmarks,
        ours.remove_landmark,
        ours.suggest_landmarks,
        ours.add_obstacle,
        ours.remove_field,
        ours.apply_as_shape_key,
        ours.field_as_nodes,
    ):
        with pytest.raises(RuntimeError, match="Linked is linked from another file; make it local first"):
            operator()


def test_a_library_override_is_refused_before_pressing():
    scenes.bar_with_handles("Linked")
    path = tempfile.mktemp(suffix=".blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = ["Linked"]
    bpy.context.collection.objects.link(into.objects[0])
    override = into.objects[0].override_create(remap_local_usages=True)
    bpy.context.view_layer.update()
    scenes.activate(override)
    ours = bpy.ops.arapfields
    for operator in (
        ours.deform,
        ours.stylize,
        ours.extract,
        ours.bake,
        ours.live,
        ours.add_handle,
        ours.fit,
    ):
        with pytest.raises(RuntimeError, match="Linked is a library override; make it local first"):
            operator()


def test_after_a_bake_the_present_frame_is_shown():
    bar = animated()
    bpy.context.scene.frame_set(1)
    bpy.ops.arapfields.bake(format="KEYS", start=1, end=5, step=2)
    keys = bpy.data.objects["Bar_baked"].data.shape_keys.key_blocks
    assert [round(key.value, 3) for key in keys[1:]] == [1.0, 0.0, 0.0]
    shift = scenes.world_points(bpy.data.objects["Bar_baked"]) - scenes.world_points(bar)
    assert np.abs(shift).max() < 0.05
