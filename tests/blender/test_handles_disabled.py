# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles that Blender does not evaluate: disabled in viewports, or left out of the view layer."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import animated
    from support.blender.bones import rigged_bar

pytestmark = pytest.mark.in_blender


def by_itself(item):
    item.hide_viewport = True


def by_its_collection(item):
    housed(item).collection.hide_viewport = True


def by_its_view_layer(item):
    housed(item).exclude = True


def housed(item):
    """The view layer's entry of a collection of an object's own."""
    home = bpy.data.collections.new("Home")
    bpy.context.scene.collection.children.link(home)
    home.objects.link(item)
    bpy.context.scene.collection.objects.unlink(item)
    return bpy.context.view_layer.layer_collection.children["Home"]


WAYS = ("by_itself", "by_its_collection", "by_its_view_layer")


@pytest.mark.parametrize("way", WAYS)
def test_a_handle_that_is_disabled_is_where_it_was_when_the_file_is_loaded(way, tmp_path):
    _, _, moving = scenes.bar_with_handles()
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.collection.objects.link(parent)
    moving.parent, parent.location.z = parent, 0.1
    moving.location.z += 0.3
    globals()[way](moving)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "disabled.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "disabled.blend"))
    bar = bpy.data.objects["Bar"]
    scenes.activate(bar)
    rest = scenes.world_points(bar)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    shift = (scenes.world_points(bar) - rest)[rest[:, 0] > 0.9]
    assert np.abs(shift - [0, 0, 0.4]).max() < 0.05


@pytest.mark.parametrize("way", WAYS)
def test_one_that_would_move_is_named_rather_than_baked_where_it_stands(way):
    bar = animated()
    globals()[way](bpy.data.objects["Moving"])
    for operator, given in (("bake", {"start": 1, "end": 3, "format": "KEYS"}), ("live", {}), ("deform", {})):
        with pytest.raises(RuntimeError, match="Moving is disabled in viewports, so that nothing moves it"):
            getattr(bpy.ops.arapfields, operator)(**given)
    assert not bar.modifiers and "Bar_baked" not in bpy.data.objects


@pytest.mark.parametrize("way", WAYS)
def test_an_armature_that_would_move_is_named_unless_others_are_posed_by_it(way):
    bar, rig = rigged_bar()
    bpy.ops.arapfields.add_bones()
    bone = rig.pose.bones["Second"]
    for frame, angle in ((1, 0.0), (3, 0.6)):
        bone.rotation_euler.z = angle
        bone.keyframe_insert("rotation_euler", frame=frame)
    scenes.activate(bar)
    globals()[way](rig)
    with pytest.raises(RuntimeError, match="is disabled in viewports, so that nothing moves it"):
        bpy.ops.arapfields.bake(start=1, end=3, format="KEYS")
    shirt = scenes.bar("Shirt")
    shirt.modifiers.new("Armature", "ARMATURE").object = rig
    scenes.activate(bar)
    assert bpy.ops.arapfields.bake(start=1, end=3, format="KEYS") == {"FINISHED"}
    baked, heights = bpy.data.objects["Bar_baked"], []
    for frame in (1, 3):
        bpy.context.scene.frame_set(frame)
        heights.append(scenes.world_points(baked)[:, 1].max())
    assert heights[1] - heights[0] > 0.2


def test_one_that_is_hidden_by_its_eye_goes_on():
    bar = animated()
    bpy.data.objects["Moving"].hide_set(True)
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.bake(start=1, end=5, format="KEYS") == {"FINISHED"}
    bpy.context.scene.frame_set(5)
    assert scenes.world_points(bpy.data.objects["Bar_baked"])[:, 2].max() > 0.6 and bar.hide_get()
