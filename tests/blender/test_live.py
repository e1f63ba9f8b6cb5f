# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode and baking, stepped by hand: without a window Blender runs no timers."""

from inside import in_blender


@in_blender
def test_the_result_follows_moves_and_returns():
    import bpy
    import numpy as np
    import scenes

    from addon.bridge import live

    bar, _, moving = scenes.bar_with_handles()
    before = scenes.world_points(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"} and live.is_live(bar)
    result = bpy.data.objects["Bar_deformed"]
    assert np.abs(scenes.world_points(result) - before).max() < 1e-3
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    live.update(bpy.context, wait=20)
    shift = scenes.world_points(result) - before
    assert np.abs(shift[before[:, 0] < -0.8]).max() < 0.1
    assert np.abs(shift[before[:, 0] > 0.8] - [0, 0, 0.4]).max() < 0.1
    scenes.activate(bar)
    bpy.ops.arapfields.reset_handle(all=True)
    bpy.context.view_layer.update()
    live.update(bpy.context, wait=20)
    assert np.abs(scenes.world_points(result) - before).max() < 0.02
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert not live.is_live(bar)


@in_blender
def test_a_new_handle_sets_the_solver_up_again():
    import bpy
    import scenes

    from addon.bridge import live

    bar, _, _ = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    scenes.activate(bar)
    bpy.ops.arapfields.add_handle()
    live.update(bpy.context, wait=20)
    assert live.is_live(bar) and len(live._sessions[bar.session_uid].layout) == 3


@in_blender
def test_animated_handles_are_baked_into_keys():
    import bpy
    import numpy as np
    import scenes

    bar, _, moving = scenes.bar_with_handles()
    for frame, height in ((1, 0.0), (5, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    assert bpy.ops.arapfields.bake(start=1, end=5, step=2) == {"FINISHED"}
    result = bpy.data.objects["Bar_deformed"]
    assert [k.name for k in result.data.shape_keys.key_blocks[1:]] == ["frame 1", "frame 3", "frame 5"]
    heights = []
    for frame in (1, 3, 5):
        bpy.context.scene.frame_set(frame)
        points = scenes.world_points(result)
        heights.append(points[scenes.world_points(bar)[:, 0] > 0.9][:, 2].mean())
    assert abs(heights[0]) < 0.03 and abs(heights[2] - 0.4) < 0.05
    assert np.all(np.diff(heights) > 0.1)


@in_blender
def test_unloading_ends_live_mode():
    import bpy
    import scenes

    from addon.bridge import live

    scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not live._sessions
