# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that are handles, and what else is known by a name, renamed."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.bones import rigged_bar
    from support.blender.live import step

    from addon.live import sessions
    from addon.solver import setup

pytestmark = pytest.mark.in_blender

QUICK = {"field": "radial", "samples": 1000}
STOPPED = 5e-4  # of the size: how far apart solves end whose targets differ by rounding alone


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
    setup.SAMPLES = 500
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


def test_a_renamed_armature_modifier_is_on_again_after_live():
    bar, _ = rigged_bar()
    bpy.ops.arapfields.add_bones()
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    bar.modifiers["Armature"].name = "Rig"
    bpy.ops.arapfields.live()
    assert bar.modifiers["Rig"].show_viewport and bar.modifiers["Rig"].show_render
