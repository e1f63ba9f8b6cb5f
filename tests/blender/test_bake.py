# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking animated handles into shape keys, and leaving it half done."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import animated, cancelled_at, stepped

    from addon.animation import caches
    from addon.core.runtime import jobs

pytestmark = pytest.mark.in_blender


def test_animated_handles_are_baked_into_keys():
    bar = animated()
    bpy.context.scene.frame_set(3)
    assert bpy.ops.arapfields.bake(format="KEYS", start=1, end=5, step=2) == {"FINISHED"}
    assert bpy.context.scene.frame_current == 3
    result = bpy.data.objects["Bar_baked"]
    assert [k.name for k in result.data.shape_keys.key_blocks[1:]] == ["frame 1", "frame 3", "frame 5"]
    heights = []
    for frame in (1, 3, 5):
        bpy.context.scene.frame_set(frame)
        points = scenes.world_points(result)
        heights.append(points[scenes.world_points(bar)[:, 0] > 0.9][:, 2].mean())
    assert abs(heights[0]) < 0.03 and abs(heights[2] - 0.4) < 0.05
    assert np.all(np.diff(heights) > 0.1)


def test_a_cancelled_bake_leaves_nothing():
    """Stepped as a window would: cancelled while solving and while storing."""
    bar = animated()

    def names():
        kinds = bpy.data.objects, bpy.data.meshes, bpy.data.actions, bpy.data.collections, bpy.data.shape_keys
        return [sorted(kind.keys()) for kind in kinds]

    before = names()
    for stage in ("frame 2", "Storing frame 3"):
        operator = stepped(format="KEYS", start=1, end=5)
        assert cancelled_at(operator, stage) == {"CANCELLED"}, stage
        assert operator.said == "Bake cancelled"
        assert bpy.context.scene.frame_current == 1 and bar.name == "Bar"
        assert names() == before and not bar.hide_get(), stage


def test_many_keys_say_what_they_weigh():
    animated()
    caches.HEAVY = 1e3
    try:
        assert bpy.ops.arapfields.bake(format="KEYS", start=1, end=2) == {"FINISHED"}
    finally:
        caches.HEAVY = 500e6
    warnings = [text for level, text in jobs.messages() if level == "WARNING"]
    assert warnings == [
        "Bar: Shape keys of 13.9 kB in the .blend and in memory; a cache would take neither"
    ], warnings
