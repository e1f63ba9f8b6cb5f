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
    assert bpy.ops.arapfields.bake(start=1, end=5, step=2) == {"FINISHED"}
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


@in_blender
def test_a_cancelled_bake_leaves_nothing():
    """Stepped as a window would: cancelled while reading, while solving and while storing."""
    import bpy
    from test_bake import animated

    import addon.animation.operators as bake
    from addon.core.runtime import jobs
    from addon.core.runtime.coroutines import Pause

    bar = animated()

    def names():
        kinds = bpy.data.objects, bpy.data.meshes, bpy.data.actions, bpy.data.collections, bpy.data.shape_keys
        return [sorted(kind.keys()) for kind in kinds]

    before = names()

    class Operator:
        title, start, end, step = "Bake", 1, 5, 1
        in_window = False
        coroutine, prepare = bake.ARAPFIELDS_OT_bake.coroutine, bake.ARAPFIELDS_OT_bake.prepare
        read = bake.ARAPFIELDS_OT_bake.read
        conclude, apply_one = bake.JobOperator.conclude, bake.JobOperator.apply_one

        def add_message(self, level, text):
            self.said = text

    for stage in ("Reading frame 3", "frame 2", "Storing frame 3"):
        operator = Operator()
        coroutine, result = operator.coroutine(bpy.context), None
        while result is None:
            try:
                if next(coroutine) is Pause.WORKER:
                    jobs.running().join(0.001)
            except StopIteration as ended:
                result = ended.value
                break
            if stage in jobs.running().message:
                jobs.running().cancel()
        jobs.stop()
        assert result == {"CANCELLED"}, stage
        assert operator.said == "Bake cancelled"
        assert bpy.context.scene.frame_current == 1 and bar.name == "Bar"
        assert names() == before, stage
