# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones as handles, their names, and a whole character that they move."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

import arapfields as af

if IN_BLENDER:
    import bpy
    from support.blender import character, scenes
    from support.blender.live import step
    from support.blender.skins import handles_of, rigged_bar

    from addon.blender import modifier_stack
    from addon.core.runtime import jobs
    from addon.live import sessions
    from addon.solver import frame_solver
    from addon.solver.source_reader import SourceReader

pytestmark = pytest.mark.in_blender

# Bones of armatures as handles.

QUICK = {"field": "radial", "samples": 1000}
STOPPED = 5e-4  # of the size: how far apart solves end whose targets differ by rounding alone
SAME = 1e-6  # of the size: single precision of matrices and positions


def test_posed_bones_drive_the_field_live_and_the_armature_is_not_doubled():
    bar, rig = rigged_bar()
    rest = scenes.world_points(bar)
    assert bpy.ops.arapfields.add_bones() == {"FINISHED"}
    entries = bar.arapfields.handles
    assert [(e.kind, e.bone, e.group) for e in entries] == [
        ("BONE", "Bone", "Bone"),
        ("BONE", "Second", "Second"),
    ]
    assert all(entry.inside > 0 for entry in entries) and bar.modifiers["Armature"].show_viewport
    scenes.activate(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    assert not bar.modifiers["Armature"].show_viewport and not bar.modifiers["Armature"].show_render
    rig.pose.bones["Second"].rotation_euler.z = 0.8
    step(refined=True)
    assert sessions.is_live(bar)
    moved = scenes.world_points(bar)
    turned = rest[rest[:, 0] > 0.9]
    matrix = np.array(rig.matrix_world @ rig.pose.bones["Second"].matrix)
    matrix = matrix @ np.linalg.inv(np.array(rig.matrix_world @ rig.data.bones["Second"].matrix_local))
    expected = turned @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.abs(moved[rest[:, 0] > 0.9] - expected).max() < 0.05
    assert np.abs(moved - rest)[rest[:, 0] < -0.9].max() < 0.05
    bpy.ops.arapfields.live()
    assert bar.modifiers["Armature"].show_viewport and bar.modifiers["Armature"].show_render
    assert [m.name for m in bar.modifiers] == ["Armature"] and not bar.arapfields.silenced


def test_a_bone_equals_a_constrained_empty_with_the_same_region():
    bar, rig = rigged_bar()
    rest = scenes.world_points(bar)
    bar.scale, rig.location = (1.2, 1.2, 1.2), (0.1, 0.2, -0.1)
    bpy.context.view_layer.update()
    bpy.ops.arapfields.add_bones()
    empties = []
    for name in ("Bone", "Second"):
        empty = scenes.cube_empty((0, 0, 0), (0.2, 0.3, 0.4), name)
        follow = empty.constraints.new("COPY_TRANSFORMS")
        follow.target, follow.subtarget = rig, name
        empties.append(empty)
    bpy.context.view_layer.update()
    scenes.activate(rig, bar)

    def posed(angle):
        rig.pose.bones["Second"].rotation_euler.z = angle
        rig.pose.bones["Bone"].location.z = 0.3 * angle
        bpy.context.view_layer.update()

    motions, asked = [], []
    for kind in ("BONE", "GROUP"):
        posed(0.0)
        if kind == "GROUP":
            while len(bar.arapfields.handles):
                bpy.ops.arapfields.remove_handle()
            for empty in empties:
                scenes.activate(empty, bar)
                bpy.ops.arapfields.add_handle(kind="GROUP", group=empty.name.split(".")[0])
                bar.arapfields.handles[-1].hold_from = 0.8
            bar.modifiers["Armature"].show_viewport = False
        posed(0.7)
        scenes.activate(bar)
        asked.append(handles_of(bar))
        assert bpy.ops.arapfields.deform(**QUICK, result="MODIFIER") == {"FINISHED"}
        motions.append(scenes.world_points(bar))
        bpy.ops.arapfields.remove_field()
    moved = np.linalg.norm(motions[0] - 1.2 * rest, axis=1)
    for (held, motion), (same_held, same_motion) in zip(*asked, strict=True):
        assert np.array_equal(held, same_held) and len(held) > 100
        assert np.abs(motion - same_motion).max() < SAME
    assert np.abs(motions[0] - motions[1]).max() < STOPPED * np.ptp(rest, axis=0).max() and moved.max() > 0.4


def test_frames_in_any_order_give_the_same_poses():
    bar, rig = rigged_bar()
    bone = rig.pose.bones["Second"]
    for frame, angle in ((1, 0.0), (5, 0.6), (9, -0.6)):
        bone.rotation_euler.z = angle
        bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(7)  # handles are made amid the motion
    bpy.ops.arapfields.add_bones()
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    shown = {}
    for frame in (1, 5, 9, 3, 9, 5, 1):
        bpy.context.scene.frame_set(frame)
        step(refined=True)
        points = scenes.world_points(bar)
        before = shown.setdefault(frame, points)
        assert np.abs(before - points).max() < 1e-4  # each frame is solved from rest
    assert np.abs(shown[5] - shown[9]).max() > 0.5


def test_bones_without_groups_hold_what_lies_about_them():
    bar, rig = rigged_bar(with_groups=False)
    assert bpy.ops.arapfields.add_bones(bones="DEFORMING") == {"FINISHED"}
    assert [entry.group for entry in bar.arapfields.handles] == ["", ""]
    held = [entry.inside for entry in bar.arapfields.handles]
    assert min(held) > 1000 and sum(held) < 4000
    rest = scenes.world_points(bar)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    rig.pose.bones["Second"].rotation_euler.z = 0.5
    step(refined=True)
    shift = scenes.world_points(bar) - rest
    assert np.linalg.norm(shift[rest[:, 0] > 0.9], axis=1).mean() > 0.3
    assert np.abs(shift[rest[:, 0] < -0.9]).max() < 0.05


def test_bones_whose_envelopes_are_wider_than_the_mesh_hold_what_is_nearest():
    """As in files whose armature is scaled; a bone far from the mesh is no handle."""
    bar, rig = rigged_bar(with_groups=False)
    scenes.activate(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    far = rig.data.edit_bones.new("Far")
    far.head, far.tail = (0, 0, 9), (0, 0, 10)
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in rig.data.bones:
        bone.envelope_distance = 25.0
    scenes.activate(rig, bar)
    assert bpy.ops.arapfields.add_bones(bones="DEFORMING") == {"FINISHED"}
    handles = bar.arapfields.handles
    assert [entry.bone for entry in handles] == ["Bone", "Second"]
    assert min(entry.inside for entry in handles) > 1000
    bar.location.z = -500
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="No bone of Armature is near the surface of Bar"):
        bpy.ops.arapfields.add_bones(bones="DEFORMING")


def test_what_is_wrong_with_bones_is_named():
    bar = scenes.bar()
    with pytest.raises(RuntimeError, match="Bar follows no armature"):
        bpy.ops.arapfields.add_bones()
    bpy.data.objects.remove(bar)
    bar, rig = rigged_bar()
    with pytest.raises(RuntimeError, match="No bone of Armature is selected"):
        for bone in rig.pose.bones:
            (bone if hasattr(bone, "select") else bone.bone).select = False
        bpy.ops.arapfields.add_bones(bones="SELECTED")
    bpy.ops.arapfields.add_bones()
    scenes.edit_bones(rig, lambda bones: bones.remove(bones["Second"]))
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="Armature has no bone Second"):
        bpy.ops.arapfields.deform()
    assert len(bar.arapfields.handles) == 2 and bar.modifiers["Armature"].show_viewport
    empty = bpy.data.objects.new("Hollow", bpy.data.armatures.new("Hollow"))
    bpy.context.collection.objects.link(empty)
    scenes.activate(empty, bar)
    with pytest.raises(RuntimeError, match="The armature Hollow has no bones to pose"):
        bpy.ops.arapfields.add_bones()
    bpy.data.objects.remove(rig)
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="Drag a pin or add a handle first"):
        bpy.ops.arapfields.deform()


def test_handle_operators_work_on_bones():
    bar, rig = rigged_bar()
    bpy.ops.arapfields.add_bones()
    rig.pose.bones["Second"].rotation_euler.z = 0.5
    rig.pose.bones["Bone"].rotation_mode = "XYZ"
    rig.pose.bones["Bone"].rotation_euler.x = 0.3
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.reset_handle(all=True)
    for bone in rig.pose.bones:
        assert np.abs(np.array(bone.matrix) - np.array(bone.bone.matrix_local)).max() < SAME
    bpy.ops.arapfields.remove_handle(delete=True)
    assert len(bar.arapfields.handles) == 1 and rig.name in bpy.data.objects
    bpy.ops.arapfields.live()
    bpy.ops.arapfields.live_keep()
    assert not bar.modifiers["Armature"].show_viewport
    bpy.ops.arapfields.remove_field()
    assert bar.modifiers["Armature"].show_viewport


def test_a_replaced_mesh_is_not_posed_again():
    bar, rig = rigged_bar()
    bpy.ops.arapfields.add_bones()
    rig.pose.bones["Second"].rotation_euler.z = 0.5
    scenes.activate(bar)
    assert bpy.ops.arapfields.deform(**QUICK, result="REPLACE") == {"FINISHED"}
    once = scenes.world_points(bar)
    assert bpy.ops.arapfields.deform(**QUICK, result="REPLACE") == {"FINISHED"}
    assert np.abs(scenes.world_points(bar) - once).max() < 0.01 and np.ptp(once, axis=0)[1] > 0.6


def test_an_armature_modifier_without_an_armature_is_passed_over():
    """Blender takes no Empty there: the modifier has no object."""
    bar, _, _ = scenes.bar_with_handles()
    modifier = bar.modifiers.new("Armature", "ARMATURE")
    modifier.object = bpy.data.objects["Fixed"]
    assert modifier.object is None and modifier_stack.rig_of(modifier) is None
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="Bar follows no armature; select one as well"):
        bpy.ops.arapfields.add_bones()
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert bpy.ops.arapfields.live() == {"FINISHED"}


# Bones that are handles, and what else is known by a name, renamed.


def renamed_second(rig, way):
    """Renames the bones of an armature; the new name of the second one."""
    if way == "swapped":
        for old, new in (("Second", "other"), ("Bone", "Second"), ("other", "Bone")):
            rig.data.bones[old].name = new
        return "Bone"
    if way == "copied":  # a copy keeps what tells the bone from others
        scenes.activate(rig)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.armature.select_all(action="SELECT")
        bpy.ops.armature.duplicate()
        bpy.ops.object.mode_set(mode="OBJECT")
    if way == "edited":
        scenes.edit_bones(rig, lambda bones: setattr(bones["Second"], "name", "Arm"))
    else:
        rig.data.bones["Second"].name = "Arm"
    return "Arm"


@pytest.mark.parametrize("way", ["posed", "edited", "swapped", "copied"])
@pytest.mark.parametrize("with_groups", [True, False])
def test_a_renamed_bone_stays_a_handle_and_live(way, with_groups):
    bar, rig = rigged_bar(with_groups)
    if with_groups:
        bpy.ops.arapfields.add_bones()
    else:
        bpy.ops.arapfields.add_bones(bones="DEFORMING")
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    rig.pose.bones["Second"].rotation_euler.z = 0.4
    step(refined=True)
    before = scenes.world_points(bar)
    name = renamed_second(rig, way)
    step(refined=True)
    size = np.ptp(before, axis=0).max()
    assert sessions.is_live(bar) and np.abs(scenes.world_points(bar) - before).max() < STOPPED * size
    rig.pose.bones[name].rotation_euler.z = 0.8
    step(refined=True)
    moved = scenes.world_points(bar)
    assert np.abs(moved - before).max() > 0.3
    bpy.ops.arapfields.live()
    scenes.activate(bar)
    assert bpy.ops.arapfields.deform(**QUICK) == {"FINISHED"}
    assert np.abs(scenes.world_points(bar) - moved).max() < 0.05 * size
    again = bpy.ops.arapfields.add_bones if with_groups else bpy.ops.arapfields.set_rest
    scenes.activate(rig, bar)
    if way != "copied":
        assert again() == {"FINISHED"} and len(bar.arapfields.handles) == 2


def test_a_renamed_bone_is_undone_and_redone_while_live():
    frame_solver.SAMPLES = 500
    bar, rig = rigged_bar()
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.arapfields.add_bones()
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    rig.pose.bones["Second"].rotation_euler.z = 0.4
    step(refined=True)
    names = ["Second", "Arm", "Hand"]
    for name in names:
        bpy.data.armatures[0].bones[1].name = name
        bpy.ops.ed.undo_push(message=name)
        step(refined=True)
    shown = scenes.world_points(bpy.data.objects["Bar"])
    for undone, name in ((True, "Arm"), (True, "Second"), (False, "Arm"), (False, "Hand")):
        (bpy.ops.ed.undo if undone else bpy.ops.ed.redo)()
        step(refined=True)
        bar = bpy.data.objects["Bar"]
        assert bpy.data.armatures[0].bones[1].name == name and sessions.is_live(bar)
        assert np.abs(scenes.world_points(bar) - shown).max() < STOPPED * np.ptp(shown, axis=0).max()


def test_a_bone_that_is_renamed_while_its_weights_are_read_is_read_again():
    bar, rig = rigged_bar()
    bpy.ops.arapfields.add_bones()
    reader = SourceReader(bpy.context, bar, "DEFORM", in_place=True)
    reading = reader.read_setup(bpy.context)
    next(reading)
    rig.data.bones["Second"].name = "Hand"
    list(reading)
    assert [entry.group for entry in bar.arapfields.handles] == ["Bone", "Hand"]
    assert len(reader.handles) == 2 and reader.setup is not None


def test_a_renamed_armature_modifier_is_on_again_after_live():
    bar, _ = rigged_bar()
    bpy.ops.arapfields.add_bones()
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    bar.modifiers["Armature"].name = "Rig"
    bpy.ops.arapfields.live()
    assert bar.modifiers["Rig"].show_viewport and bar.modifiers["Rig"].show_render


# A whole character moves by its bones: eyes stay in their sockets, hair on the head.

STEPS = 4  # of live mode, in which its solver comes to rest


@pytest.mark.slow  # about ten seconds
def test_a_character_moves_whole():
    person = character.build()
    rest = {
        item.name: character.seen_mesh(item)[0]
        for item in (person.body, person.shirt, person.hat, *person.eyes)
    }
    skin = rest["Body"], character.seen_mesh(person.body)[2]
    strands = hair_points(person.hair)
    jobs.board.messages.clear()
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    for share in np.linspace(0, 1, 4)[1:]:
        character.pose(person, neck=share * np.pi / 4, arm=share * np.pi / 3)
        for _ in range(STEPS):
            step(refined=True)
    assert sessions.is_live(person.body) and not jobs.messages(), jobs.messages()
    now = {name: character.seen_mesh(bpy.data.objects[name])[0] for name in rest}
    posed = now["Body"], skin[1]
    figures = {}

    head = rest["Body"][:, 2] > 1.6
    turn = rigid(rest["Body"][head], now["Body"][head])
    angle = np.degrees(np.arccos((np.trace(turn[:3, :3]) - 1) / 2))
    figures["head turned, degrees"] = angle
    hand = rest["Body"][:, 0] > 0.75
    figures["hand raised"] = (now["Body"][hand] - rest["Body"][hand])[:, 2].mean()

    for eye in person.eyes:
        before, after = rest[eye.name], now[eye.name]
        center = before.mean(axis=0)
        socket = np.linalg.norm(rest["Body"] - center, axis=1) < 2.5 * character.EYE
        with_socket = rigid(rest["Body"][socket], now["Body"][socket])
        off = after.mean(axis=0) - (with_socket[:3, :3] @ center + with_socket[:3, 3])
        figures[f"{eye.name} off its socket, of its radius"] = np.linalg.norm(off) / character.EYE
        depths = distances(*skin, before), distances(*posed, after)
        clear = np.abs(depths[0]) > 0.05 * character.EYE
        figures[f"{eye.name} cut by the skin, vertices"] = int((depths[0] * depths[1] < 0)[clear].sum())

    off = distances(*skin, rest["Shirt"]), distances(*posed, now["Shirt"])
    figures["shirt's distance changes on average"] = np.abs(off[1] / off[0] - 1).mean()
    figures["shirt's mean distance changes"] = abs(off[1].mean() / off[0].mean() - 1)
    figures["shirt's least distance, of its own"] = (off[1] / off[0]).min()

    roots = hair_points(person.hair)[:, 0]
    figures["hair roots off the scalp, of the size"] = (
        np.abs(distances(*posed, roots)).max() / character.HEIGHT
    )
    figures["hair roots off at rest"] = np.abs(distances(*skin, strands[:, 0])).max() / character.HEIGHT
    on_head = rest["Hat"] @ turn[:3, :3].T + turn[:3, 3]
    figures["hat off the head's motion, of the size"] = (
        np.linalg.norm(now["Hat"] - on_head, axis=1).max() / character.HEIGHT
    )
    for name, value in figures.items():
        print(f"{name}: {value:.3g}")

    assert 40 < figures["head turned, degrees"] < 50 and figures["hand raised"] > 0.4
    for eye in person.eyes:
        assert figures[f"{eye.name} off its socket, of its radius"] < 0.02
        assert not figures[f"{eye.name} cut by the skin, vertices"]
    assert figures["shirt's distance changes on average"] <= 0.03
    assert figures["shirt's least distance, of its own"] > 0
    assert figures["hair roots off the scalp, of the size"] <= 1e-4
    assert figures["hat off the head's motion, of the size"] < 0.02
    bpy.ops.arapfields.live()
    character.pose(person, 0, 0)
    for name, before in rest.items():
        assert np.abs(character.seen_mesh(bpy.data.objects[name])[0] - before).max() < 1e-4


def distances(vertices, triangles, points):
    """(p,) signed distances of points from a surface, negative inside."""
    return af.signed_distance(vertices, triangles, points)


def hair_points(hair):
    """(strands, points of each, 3) as they are shown."""
    data = hair.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    flat = np.empty(3 * len(data.points), np.float32)
    data.attributes["position"].data.foreach_get("vector", flat)
    return flat.reshape(len(data.curves), -1, 3).astype(np.float64)


def rigid(before, after):
    return af.rigid_motion(before, after)
