# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights and correctives of an armature, and skinned files elsewhere."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Quaternion
    from support.blender import scenes
    from support.blender.baking import cancelled_at, changed_at_work
    from support.blender.panels import drawn
    from support.blender.skins import SIDES, eye, person, shirt, weights_of
    from support.blender.stages import Operator

    from addon.core.runtime import jobs
    from addon.names import CORRECTIVE
    from addon.skin.operators import ARAPFIELDS_OT_skin

# Skin weights and correctives of an armature.

# Skin to Armature: groups, modifier, several meshes, correctives, what is kept, refusals, one undo.

QUICK = {"poses": 8, "samples": 800}


def posed(rig, **turns):
    for name, (axis, angle) in turns.items():
        bone = rig.pose.bones[name.replace("_", ".")]
        bone.rotation_mode, bone.rotation_quaternion = "QUATERNION", Quaternion(axis, angle)
    bpy.context.view_layer.update()


@pytest.mark.in_blender
def test_several_meshes_get_weights_and_a_modifier():
    body, rig = person()
    cloth, ball = shirt(body), eye()
    scenes.activate(cloth, ball, body, rig)
    assert bpy.ops.arapfields.skin(**QUICK) == {"FINISHED"}
    names = [bone.name for bone in rig.data.bones]
    for item in (body, cloth, ball):
        weights = weights_of(item, names)
        assert np.allclose(weights.sum(axis=1), 1, atol=1e-5) and ((weights > 0).sum(axis=1) <= 4).all()
        (modifier,) = [m for m in item.modifiers if m.type == "ARMATURE"]
        assert modifier.object == rig and item.parent == rig and "Helper" not in item.vertex_groups
    # the eye moves as one, the cloth as what lies under it
    assert np.ptp(weights_of(ball, names), axis=0).max() == 0
    before = scenes.world_points(body), scenes.world_points(cloth), scenes.world_points(ball)
    below = np.linalg.norm(before[1][:, None] - before[0], axis=2).argmin(axis=1)
    assert np.abs(weights_of(cloth, names) - weights_of(body, names)[below]).mean() < 0.02
    posed(rig, Thigh_L=((1, 0, 0), 0.6))
    after = scenes.world_points(body)
    low = before[0][:, 2] < 0.3
    moved = np.linalg.norm(after - before[0], axis=1)
    assert moved[low & (before[0][:, 0] > 0)].min() > 0.1 and moved[low & (before[0][:, 0] < 0)].max() < 2e-3
    rig.location.x += 1.0
    bpy.context.view_layer.update()
    assert np.allclose(scenes.world_points(body), after + np.eye(3)[0], atol=1e-5)


@pytest.mark.in_blender
def test_sides_are_alike_and_a_second_time_uses_the_modifier():
    body, rig = person()
    scenes.activate(body, rig)
    for _ in range(2):
        assert bpy.ops.arapfields.skin(**QUICK) == {"FINISHED"}
    assert len(body.modifiers) == 1
    names = [bone.name for bone in rig.data.bones]
    weights, points = weights_of(body, names), scenes.world_points(body)
    twin = np.linalg.norm(points[:, None] * [-1, 1, 1] - points, axis=2)
    paired, twin = twin.min(axis=1) < 1e-5, twin.argmin(axis=1)
    other = [names.index(bpy.utils.flip_name(name)) for name in names]
    assert paired.mean() > 0.9 and np.abs(weights[paired] - weights[twin[paired]][:, other]).max() < 1e-3


@pytest.mark.in_blender
def test_locked_groups_stay_and_others_are_kept_by_choice():
    body, rig = person()
    names = [bone.name for bone in rig.data.bones]
    spine, other = body.vertex_groups.new(name="Spine"), body.vertex_groups.new(name="Pins")
    spine.add(range(0, len(body.data.vertices), 2), 0.25, "REPLACE")
    other.add([3], 0.5, "REPLACE")
    spine.lock_weight = True
    scenes.activate(body, rig)
    bpy.ops.arapfields.skin(**QUICK)
    weights = weights_of(body, names)
    assert np.allclose(weights[:, names.index("Spine")], np.arange(len(weights)) % 2 * -0.25 + 0.25)
    shared = weights.sum(axis=1)[weights.max(axis=1) > 0.26]
    assert np.allclose(shared, 1, atol=1e-5) and ((weights > 0).sum(axis=1) <= 4).all()
    assert len(shared) > 0.4 * len(weights)
    assert np.flatnonzero(weights_of(body, ["Pins"])).tolist() == [3]
    spine.lock_weight = False
    scenes.activate(body, rig)
    bpy.ops.arapfields.skin(groups="KEEP", **QUICK)
    assert np.allclose(weights_of(body, names), weights, atol=1e-6)
    bpy.ops.arapfields.skin(**QUICK)
    assert np.abs(weights_of(body, names) - weights).max() > 0.1


@pytest.mark.in_blender
def test_generated_vertices_and_a_scaled_turned_object():
    """A half that Mirror completes, and Subdivision after the armature."""
    body, rig = person(half=True)
    body.modifiers.new("Mirror", "MIRROR")
    body.modifiers.new("Subdivision", "SUBSURF")
    for item in (body, rig):
        item.scale, item.rotation_euler.z, item.location.x = (2, 2, 2), 0.7, 3
    scenes.activate(body, rig)
    assert bpy.ops.arapfields.skin(correctives=2, **QUICK) == {"FINISHED"}
    assert [m.type for m in body.modifiers] == ["MIRROR", "ARMATURE", "SUBSURF"]
    weights = weights_of(body, [bone.name for bone in rig.data.bones])
    assert np.allclose(weights.sum(axis=1), 1, atol=1e-5) and body.data.shape_keys is None
    assert {group.name[-2:] for group in body.vertex_groups} == {"ne", ".L", ".R"}


@pytest.mark.in_blender
def test_correctives_are_keys_with_plain_drivers():
    body, rig = person()
    scenes.activate(body, rig)
    for count in (5, 2):  # a key of one leg has its twin; the second time replaces the first
        assert bpy.ops.arapfields.skin(correctives=count, **QUICK) == {"FINISHED"}
    keys = [key for key in body.data.shape_keys.key_blocks if key.name.startswith(CORRECTIVE)]
    drivers = body.data.shape_keys.animation_data.drivers
    assert len(keys) == 2 == len(drivers) and len(body.data.shape_keys.key_blocks) == 3
    assert all(curve.driver.is_valid and curve.driver.is_simple_expression for curve in drivers)
    assert max(abs(key.value) for key in keys) < 1e-6
    turns = {f"{bone}_{side}": ((1, 0.3, 0.2), 0.5) for bone in ("Thigh", "Shin") for side in SIDES}
    posed(rig, **turns)
    assert max(abs(key.value) for key in keys) > 0.05
    largest = []
    for axis in np.eye(3):
        posed(rig, **{name: (axis, 1.5) for name in turns})
        largest += [abs(key.value) for key in keys]
    assert max(largest) == 1  # no farther than in the poses seen
    bpy.ops.arapfields.skin(**QUICK)
    assert len(body.data.shape_keys.key_blocks) == 1


@pytest.mark.in_blender
def test_the_pose_at_hand_does_not_matter():
    body, rig = person()
    scenes.activate(body, rig)
    bpy.ops.arapfields.skin(**QUICK)
    names = [bone.name for bone in rig.data.bones]
    first = weights_of(body, names)
    posed(rig, Thigh_L=((1, 0, 0), 0.6))
    bpy.ops.arapfields.skin(**QUICK)
    assert rig.data.pose_position == "POSE" and np.allclose(weights_of(body, names), first, atol=1e-5)


@pytest.mark.in_blender
def test_control_bones_move_nothing_and_are_named():
    body, rig = person()

    def add(bones):
        one = bones.new("IK.Spine")
        one.head, one.tail = bones["Spine"].head, bones["Spine"].tail
        pole = bones.new("Pole")
        pole.head, pole.tail = (0, -0.4, 0.4), (0, -0.5, 0.4)

    scenes.edit_bones(rig, add)
    scenes.activate(body, rig)
    assert bpy.ops.arapfields.skin(**QUICK) == {"FINISHED"}
    assert not {"IK.Spine", "Pole"} & set(body.vertex_groups.keys())
    texts = [text for level, text in jobs.messages() if level == "WARNING"]
    assert any("others lie there: IK.Spine" in text for text in texts), texts
    assert any("No vertex follows Pole" in text for text in texts), texts


def far_bone(body, rig):
    scenes.edit_bones(
        rig, lambda bones: setattr(bones["Spine"], "tail", (0, 0, 1.0)) or far(bones.new("Far"))
    )


def far(bone):
    bone.head, bone.tail = (9, 0, 0), (9, 0, 1)


def no_deforming(body, rig):
    for bone in rig.data.bones:
        bone.use_deform = False


def no_bones(body, rig):
    scenes.edit_bones(rig, lambda bones: [bones.remove(bone) for bone in list(bones)])


def no_faces(body, rig):
    body.data.clear_geometry()
    body.data.vertices.add(3)


def no_area(body, rig):
    for vertex in body.data.vertices:
        vertex.co = (vertex.co.x, 0.0, 0.0)


def on_a_bone(body, rig):
    body.parent, body.parent_type, body.parent_bone = rig, "BONE", "Spine"


def in_edit_mode(body, rig):
    scenes.activate(rig)
    bpy.ops.object.mode_set(mode="EDIT")


def bones_are_handles(body, rig):
    scenes.activate(rig, body)
    bpy.ops.arapfields.add_bones()


REFUSALS = {
    "far outside": far_bone,
    "No bone of Rig deforms": no_deforming,
    "Rig has no bones": no_bones,
    "Body: the mesh has no faces": no_faces,
    "Body: its faces have no area": no_area,
    "Body moves with a bone already": on_a_bone,
    "Rig is in Edit Mode": in_edit_mode,
    "bones of Rig are handles of Body": bones_are_handles,
    "Select the meshes, then the armature": lambda body, rig: bpy.data.objects.remove(rig),
    "Body is linked from another file": None,
}


@pytest.mark.in_blender
@pytest.mark.parametrize("reason", REFUSALS)
def test_refusals_name_the_reason_and_change_nothing(reason, tmp_path):
    body, rig = person()
    if REFUSALS[reason] is None:
        path = f"{tmp_path}/body.blend"
        bpy.data.libraries.write(path, {body.data})
        with bpy.data.libraries.load(path, link=True) as (_, wanted):
            wanted.meshes = ["Body"]
        body.data = wanted.meshes[0]
    else:
        REFUSALS[reason](body, rig)
    scenes.activate(body) if "then" in reason else scenes.activate(body, rig)
    with pytest.raises(RuntimeError, match=reason):
        bpy.ops.arapfields.skin(**QUICK)
    assert not body.modifiers and not body.vertex_groups and body.data.shape_keys is None


# Skin to Armature: undo, files, cancel, and what it finds and leaves: other rigs, links, hidden meshes.

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


@pytest.mark.in_blender
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


@pytest.mark.in_blender
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


@pytest.mark.in_blender
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


@pytest.mark.in_blender
@pytest.mark.parametrize("change", ["removed", "renamed", "moved"])
def test_bones_that_change_meanwhile_leave_the_meshes_as_they_are(change):
    def changed(_, rig):
        if change == "renamed":
            rig.data.bones["Shin.L"].name = "Calf.L"
        else:
            scenes.edit_bones(rig, CHANGES[change])

    said, before, now = changed_meanwhile(changed)
    assert said == ["Rig changed while it was worked on; run again"] and now == before


@pytest.mark.in_blender
@pytest.mark.parametrize("which", ["body", "rig"])
def test_what_moves_beside_the_armature_meanwhile_is_not_skinned(which):
    def moved(body, rig):
        (body if which == "body" else rig).location.x = 2

    said, before, now = changed_meanwhile(moved)
    assert said == ["Body changed while it was worked on; run again"] and now == before


@pytest.mark.in_blender
def test_what_moves_with_the_armature_meanwhile_is_skinned():
    def both(body, rig):
        rig.pose.bones["Thigh.L"].rotation_quaternion = (0.9, 0.1, 0, 0)
        for item in (body, rig):
            item.location, item.rotation_euler = (300, 0, 0), (0.3, 1, 2)

    said, before, now = changed_meanwhile(both)
    assert said[0].startswith("Rig: 5 bones move Body") and now != before


@pytest.mark.in_blender
def test_a_script_names_mesh_and_armature_by_an_override_of_the_context():
    body, rig = person()
    scenes.activate(scenes.bar())
    with bpy.context.temp_override(active_object=rig, selected_objects=[body, rig]):
        assert bpy.ops.arapfields.skin(scope="SELECTED", poses=8, samples=800) == {"FINISHED"}
    assert body.vertex_groups and not bpy.context.object.vertex_groups


@pytest.mark.in_blender
@pytest.mark.parametrize("which", ["Body", "Rig"])
def test_a_scale_that_flattens_is_named(which):
    scenes.activate(*person())
    bpy.data.objects[which].scale.z = 0
    with pytest.raises(RuntimeError, match=f"{which}: its scale flattens it"):
        bpy.ops.arapfields.skin(scope="SELECTED", poses=8, samples=800)


@pytest.mark.in_blender
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


@pytest.mark.in_blender
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


@pytest.mark.in_blender
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


# A skinned file elsewhere: as glTF, in a Blender without the extension, and made by the command.

ROOT = Path(__file__).resolve().parents[2]
# Without the extension: what is seen in some poses, and what the glTF exporter makes of them.
PLAY = """
import bpy, numpy as np, sys
from mathutils import Quaternion
source, target = sys.argv[-2:]
assert not bpy.context.preferences.filepaths.use_scripts_auto_execute
bpy.ops.wm.open_mainfile(filepath=source, use_scripts=False)
assert not hasattr(bpy.types.Object, "arapfields")
rig, body, seen = bpy.data.objects["Rig"], bpy.data.objects["Body"], []
scene = bpy.context.scene
scene.frame_start, scene.frame_end = 1, 3
random = np.random.default_rng(0)
for frame in (1, 2, 3):
    for bone in rig.pose.bones:
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = Quaternion(random.normal(size=3).tolist(), (frame - 1) * 0.3)
        bone.keyframe_insert("rotation_quaternion", frame=frame)
for frame in (1, 2, 3):
    scene.frame_set(frame)
    mesh = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    seen.append([list(body.matrix_world @ vertex.co) for vertex in mesh.vertices])
keys = [key.value for key in body.data.shape_keys.key_blocks]
np.savez(target + ".npz", seen=seen, keys=keys)
if "{gltf}":
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    bpy.ops.export_scene.gltf(filepath=target + ".glb", export_yup=False, export_morph_normal=False,
                              export_frame_range=True, export_force_sampling=True, export_normals=False)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=target + ".glb")
    item, again = next(one for one in bpy.data.objects if one.type == "MESH" and one.vertex_groups), []
    for key in item.data.shape_keys.key_blocks:
        key.slider_min = -1  # which the importer leaves at 0
    for frame in (1, 2, 3):
        bpy.context.scene.frame_set(frame)
        mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
        points = np.array([item.matrix_world @ vertex.co for vertex in mesh.vertices])
        again.append(points[:, [0, 2, 1]] * [1, 1, -1])  # exported with z up, read as y up
    np.savez(target + "_again.npz", again=again)
"""


def save_person(path):
    """In the worker."""
    person()
    bpy.ops.wm.save_as_mainfile(filepath=path)


def run_blender(text, environment, *arguments):
    done = subprocess.run(
        [sys.executable, "-c", text, *map(str, arguments)], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


@pytest.fixture
def skinned(blender, command, tmp_path):
    """A .blend that the command has skinned."""
    source, target = tmp_path / "body.blend", tmp_path / "skinned.blend"
    blender.call(__file__, "save_person", {"path": source})
    call = ["skin", "-i", source, "-o", target, "--quiet"]
    done = command(*call, "--poses", 8, "--samples", 1000, "--correctives", 3)
    assert "bones move Body" in done.stdout
    named = command(*call, "--armature", "X", check=False)
    assert named.returncode == 2 and "--armature names one of: Rig" in named.stderr
    return target


def matrices(gltf, values, node, frame):
    """(4, 4) of a node in the world at a frame, from the animation's sampled channels."""
    own, parents = {}, {child: k for k, one in enumerate(gltf.nodes) for child in one.children or ()}
    for channel in gltf.animations[0].channels:
        if channel.target.node == node:
            sampler = gltf.animations[0].samplers[channel.sampler]
            own[channel.target.path] = values(sampler.output)[min(frame, len(values(sampler.output)) - 1)]
    one, result = gltf.nodes[node], np.eye(4)
    x, y, z, w = own.get("rotation", one.rotation or (0, 0, 0, 1))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    result[:3, :3] = turn * np.asarray(own.get("scale", one.scale or (1, 1, 1)))
    result[:3, 3] = own.get("translation", one.translation or (0, 0, 0))
    return matrices(gltf, values, parents[node], frame) @ result if node in parents else result


def test_it_plays_bit_for_bit_without_the_extension_and_as_gltf(skinned, user_folder, tmp_path):
    """The glTF by an independent reader, skinned in NumPy."""
    register = f"import sys; sys.path[:0] = [{str(ROOT)!r}]\nimport addon\naddon.register()\n"
    beside = PLAY.format(gltf="").replace("assert not hasattr", "assert hasattr")
    run_blender(register + beside, user_folder, skinned, tmp_path / "with")
    run_blender(PLAY.format(gltf="yes"), user_folder, skinned, tmp_path / "play")
    with np.load(tmp_path / "play.npz") as played, np.load(tmp_path / "with.npz") as other:
        seen = played["seen"]
        assert seen.tobytes() == other["seen"].tobytes() and np.abs(played["keys"]).max() > 0.05
    with np.load(tmp_path / "play_again.npz") as read_back:
        for points, expected in zip(read_back["again"], seen, strict=True):  # Blender's importer
            off = np.linalg.norm(points[:, None] - expected, axis=2).min(axis=1)
            assert off.max() < 1e-5 * np.ptp(seen[0], axis=0).max()
    pygltflib = pytest.importorskip("pygltflib")
    gltf = pygltflib.GLTF2().load(str(tmp_path / "play.glb"))
    kinds = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
    widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

    def read(place, count, component, width=1):
        view, kind = gltf.bufferViews[place.bufferView], np.dtype(kinds[component])
        begin = (view.byteOffset or 0) + (place.byteOffset or 0)
        data = gltf.binary_blob()[begin : begin + count * width * kind.itemsize]
        return np.frombuffer(data, kind).reshape(count, width)

    def values(index):
        accessor = gltf.accessors[index]
        kind, width, sparse = accessor.componentType, widths[accessor.type], accessor.sparse
        found = np.zeros((accessor.count, width))
        if accessor.bufferView is not None:
            found[:] = read(accessor, accessor.count, kind, width)
        if sparse is not None:
            rows = read(sparse.indices, sparse.count, sparse.indices.componentType)[:, 0]
            found[rows] = read(sparse.values, sparse.count, kind, width)
        return found

    node = next(k for k, one in enumerate(gltf.nodes) if one.mesh is not None)
    (primitive,) = gltf.meshes[gltf.nodes[node].mesh].primitives
    skin = gltf.skins[gltf.nodes[node].skin]
    binds = values(skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    rest, joints = values(primitive.attributes.POSITION), values(primitive.attributes.JOINTS_0).astype(int)
    shares = values(primitive.attributes.WEIGHTS_0)
    morphs = np.array([values(target["POSITION"]) for target in primitive.targets])
    weights = next(
        values(gltf.animations[0].samplers[channel.sampler].output).reshape(-1, len(morphs))
        for channel in gltf.animations[0].channels
        if channel.target.path == "weights"
    )
    for frame in range(3):
        moved = [
            matrices(gltf, values, joint, frame) @ bind
            for joint, bind in zip(skin.joints, binds, strict=True)
        ]
        points = rest + np.einsum("k,kni->ni", weights[frame], morphs)
        blend = np.einsum("nj,njab->nab", shares, np.array(moved)[joints])
        posed = np.einsum("nab,nb->na", blend, np.c_[points, np.ones(len(points))])[:, :3]
        off = np.linalg.norm(posed[:, None] - seen[frame], axis=2).min(axis=1)
        assert off.max() < 1e-5 * np.ptp(seen[0], axis=0).max(), frame
