# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin to Armature: undo, files, cancel, and what it finds and leaves: other rigs, links, hidden meshes."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import cancelled_at, changed_at_work
    from support.blender.panels import drawn
    from support.blender.skins import person, shirt, weights_of
    from support.blender.stages import Operator

    from addon.skin.operators import ARAPFIELDS_OT_skin

pytestmark = pytest.mark.in_blender
CHANGES = {
    "removed": lambda bones: bones.remove(bones["Shin.L"]),
    "moved": lambda bones: setattr(bones["Shin.L"].tail, "x", 0.5),
}
ATTEMPTS = 5  # a stage of some milliseconds may pass unseen on a busy machine


def seen_of(body):
    """All that skinning may change, as values."""
    keys = body.data.shape_keys
    return {
        "groups": {
            group.name: weights_of(body, [group.name]).round(6).tolist() for group in body.vertex_groups
        },
        "modifiers": [(m.name, m.type, m.object.name) for m in body.modifiers],
        "parent": (body.parent and body.parent.name, [tuple(row) for row in body.matrix_parent_inverse]),
        "keys": [(key.name, [tuple(p.co) for p in key.data]) for key in keys.key_blocks] if keys else [],
        "drivers": [c.driver.expression for c in keys.animation_data.drivers] if keys else [],
    }


def test_all_settings_of_a_rig_beside_several_meshes_are_in_reach():
    body, rig = person()
    cloth = shirt(body)
    scenes.activate(body, cloth, rig)
    texts = drawn()
    assert {"Influences", "Correctives"} <= {*texts["ARAPFIELDS_PT_skin"]}
    assert {"Poses", "Seed"} <= {*texts["ARAPFIELDS_PT_skin_settings"]} and "ARAPFIELDS_PT_advanced" in texts
    assert not [name for name in texts if name.endswith(("PT_surface", "PT_deform_settings", "PT_handles"))]
    rig.select_set(False)
    bpy.ops.object.camera_add()
    assert [name for name in drawn() if "_PT_" in name] == ["ARAPFIELDS_PT_source"]


def test_undo_a_file_and_another_armature(tmp_path):
    """Undone, done again, saved and read; an armature and a group that were there stay as they were."""
    bpy.context.preferences.edit.use_global_undo = True
    body, rig = person()
    old = rig.copy()
    old.data, old.name = rig.data.copy(), "Old"
    bpy.context.collection.objects.link(old)
    old.data.bones["Spine"].name = "Trunk"
    body.modifiers.new("Before", "ARMATURE").object = old
    body.vertex_groups.new(name="Trunk").add([1, 2, 3], 0.5, "REPLACE")
    bones = [(bone.name, tuple(bone.head_local)) for bone in old.data.bones]
    scenes.activate(body, rig)
    bpy.ops.ed.undo_push(message="before")
    before = seen_of(body)
    bpy.ops.arapfields.skin(correctives=2, poses=8, samples=1000)
    bpy.ops.ed.undo_push(message="after")
    after = seen_of(body)
    assert after["groups"]["Trunk"] == before["groups"]["Trunk"] and len(after["groups"]) == 6
    assert after["modifiers"] == [("Before", "ARMATURE", "Old"), ("Armature", "ARMATURE", "Rig")]
    assert len(after["keys"]) == 3 and after["parent"][0] == "Rig" and before["keys"] == []
    for step, expected in ((bpy.ops.ed.undo, before), (bpy.ops.ed.redo, after)):
        step()
        assert seen_of(bpy.data.objects["Body"]) == expected
    path = f"{tmp_path}/skinned.blend"
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert seen_of(bpy.data.objects["Body"]) == after
    assert [(bone.name, tuple(bone.head_local)) for bone in bpy.data.armatures["Rig.001"].bones] == bones


@pytest.mark.parametrize("stage", ["Posing", "Weights", "Correctives"])
def test_a_cancel_at_any_stage_changes_nothing(stage):
    for _ in range(ATTEMPTS):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        body, rig = person()
        scenes.activate(body, rig)
        before = seen_of(body)
        operator = Operator(ARAPFIELDS_OT_skin, poses=8, samples=1500, correctives=2)
        operator.scope = "SELECTED"
        if cancelled_at(operator, stage) == {"CANCELLED"}:
            break
    assert "cancelled" in operator.said[-1]
    assert seen_of(body) == before and rig.data.pose_position == "POSE"


def changed_meanwhile(change):
    """What Skin to Armature says where something changes meanwhile, and what the body was and is then."""
    body, rig = person()
    scenes.activate(body, rig)
    before = seen_of(body)
    operator = Operator(ARAPFIELDS_OT_skin, poses=8, samples=800)
    operator.scope = "SELECTED"
    changed_at_work(operator, lambda: change(body, rig))
    return operator.said, before, seen_of(body)


@pytest.mark.parametrize("change", ["removed", "renamed", "moved"])
def test_bones_that_change_meanwhile_leave_the_meshes_as_they_are(change):
    def changed(_, rig):
        if change == "renamed":
            rig.data.bones["Shin.L"].name = "Calf.L"
        else:
            scenes.edit_bones(rig, CHANGES[change])

    said, before, now = changed_meanwhile(changed)
    assert said == ["Rig changed while it was worked on; run again"] and now == before


@pytest.mark.parametrize("which", ["body", "rig"])
def test_what_moves_beside_the_armature_meanwhile_is_not_skinned(which):
    def moved(body, rig):
        (body if which == "body" else rig).location.x = 2

    said, before, now = changed_meanwhile(moved)
    assert said == ["Body changed while it was worked on; run again"] and now == before


def test_what_moves_with_the_armature_meanwhile_is_skinned():
    def both(body, rig):
        rig.pose.bones["Thigh.L"].rotation_quaternion = (0.9, 0.1, 0, 0)
        for item in (body, rig):
            item.location, item.rotation_euler = (300, 0, 0), (0.3, 1, 2)

    said, before, now = changed_meanwhile(both)
    assert said[0].startswith("Rig: 5 bones move Body") and now != before


def test_a_script_names_mesh_and_armature_by_an_override_of_the_context():
    body, rig = person()
    scenes.activate(scenes.bar())
    with bpy.context.temp_override(active_object=rig, selected_objects=[body, rig]):
        assert bpy.ops.arapfields.skin(scope="SELECTED", poses=8, samples=800) == {"FINISHED"}
    assert body.vertex_groups and not bpy.context.object.vertex_groups


@pytest.mark.parametrize("which", ["Body", "Rig"])
def test_a_scale_that_flattens_is_named(which):
    scenes.activate(*person())
    bpy.data.objects[which].scale.z = 0
    with pytest.raises(RuntimeError, match=f"{which}: its scale flattens it"):
        bpy.ops.arapfields.skin(scope="SELECTED", poses=8, samples=800)


def test_a_linked_armature_poses_meshes_and_hidden_meshes_of_its_collection_too(tmp_path):
    body, rig = person()
    path = f"{tmp_path}/rig.blend"
    bpy.data.libraries.write(path, {rig})
    bpy.data.objects.remove(rig)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Rig"]
    rig = wanted.objects[0]
    bpy.context.collection.objects.link(rig)
    other = shirt(body)
    scenes.activate(other, body, rig)
    other.hide_set(True)
    other.hide_viewport = True
    assert bpy.ops.arapfields.skin(poses=8, samples=1000) == {"FINISHED"}
    assert body.parent == rig and len(body.vertex_groups) == 5 and not other.vertex_groups
    assert bpy.ops.arapfields.skin(scope="COLLECTION", poses=8, samples=1000) == {"FINISHED"}
    assert np.allclose(weights_of(other, list(body.vertex_groups.keys())).sum(axis=1), 1, atol=1e-5)


def test_a_half_that_mirror_completes_follows_the_bones_of_its_own_side():
    """Mirror gives the other side the groups of its names, which are there though the half has none of it."""
    body, rig = person(half=True)
    body.modifiers.new("Mirror", "MIRROR")
    scenes.activate(body, rig)
    assert bpy.ops.arapfields.skin(poses=8, samples=800) == {"FINISHED"}
    rest, ways = scenes.world_points(body), []
    for name in ("Shin.L", "Shin.R"):
        rig.pose.bones[name].rotation_quaternion = (0.9, 0.4, 0, 0)
        ways.append(np.linalg.norm(scenes.world_points(body) - rest, axis=1))
        rig.pose.bones[name].rotation_quaternion = (1, 0, 0, 0)
    left = rest[:, 0] > 0.01
    assert ways[0][left].max() > 0.1 > 1e-3 > ways[0][~left].max()
    assert ways[1][~left].max() > 0.1 > 1e-3 > ways[1][left].max()


@pytest.mark.parametrize("kind", ["empty", "locked"])
def test_no_vertex_is_left_without_a_bone(kind):
    """Groups that hold nothing keep nothing, and what locked ones leave is held by others."""
    body, rig = person()
    for bone in rig.data.bones if kind == "empty" else (rig.data.bones["Shin.L"],):
        body.vertex_groups.new(name=bone.name).lock_weight = kind == "locked"
    scenes.activate(body, rig)
    assert bpy.ops.arapfields.skin(groups="KEEP", poses=8, samples=800) == {"FINISHED"}
    weights = weights_of(body, [bone.name for bone in rig.data.bones])
    assert np.allclose(weights.sum(axis=1), 1, atol=1e-5)
    assert weights_of(body, ["Shin.L"]).any() == (kind == "empty")
