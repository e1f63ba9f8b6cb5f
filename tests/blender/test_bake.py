# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking animated handles into shape keys, and leaving it half done."""

from inside import in_blender


def animated():
    import scenes

    bar, _, moving = scenes.bar_with_handles()
    for frame, height in ((1, 0.0), (5, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    return bar


@in_blender
def test_animated_handles_are_baked_into_keys():
    import bpy
    import numpy as np
    import scenes
    from test_bake import animated

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


def stepped(**given):
    """The bake operator as a window runs it, to be stepped by hand; a plain object has its arguments."""
    import types

    import addon.animation.operators as bake
    from addon.animation.bake_operator import BakeOperator

    class Operator(BakeOperator):
        title, in_window, scope, filepath = "Bake", False, "ACTIVE", given.pop("filepath", "")
        prepare, warn_of_weight = bake.ARAPFIELDS_OT_bake.prepare, bake.ARAPFIELDS_OT_bake.warn_of_weight
        part = (0, 0)
        properties = types.SimpleNamespace(is_property_set=lambda name: name in given)

        def add_message(self, level, text):
            self.said = text

    for name, value in given.items():
        setattr(Operator, name, value)
    return Operator()


def cancelled_at(operator, stage):
    """Steps it, cancels it when it says this, and returns what the operator does."""
    import bpy

    from addon.core.runtime import jobs
    from addon.core.runtime.coroutines import Pause

    coroutine = operator.coroutine(bpy.context)
    try:
        while True:
            if next(coroutine) is Pause.WORKER:
                jobs.running().join(0.001)
            if stage in jobs.running().message:
                jobs.running().cancel()
    except StopIteration as ended:
        return ended.value
    finally:
        jobs.stop()


@in_blender
def test_a_cancelled_bake_leaves_nothing():
    """Stepped as a window would: cancelled while solving and while storing."""
    import bpy
    from test_bake import animated, cancelled_at, stepped

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


@in_blender
def test_many_keys_say_what_they_weigh():
    import bpy
    from test_bake import animated

    from addon.animation import caches
    from addon.core.runtime import jobs

    animated()
    caches.HEAVY = 1e3
    try:
        assert bpy.ops.arapfields.bake(format="KEYS", start=1, end=2) == {"FINISHED"}
    finally:
        caches.HEAVY = 500e6
    told = [text for level, text in jobs.messages() if level == "WARNING"]
    assert told == ["Bar: shape keys of 13.9 kB in the .blend and in memory; a cache would take neither"], (
        told
    )
