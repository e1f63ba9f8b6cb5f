# SPDX-License-Identifier: GPL-3.0-or-later
"""Live mode, stepped by hand: without a window Blender runs no timers."""

from inside import in_blender

WAIT = 30  # seconds for a shape to follow


def step(refined=False):
    import bpy
    from test_live import WAIT

    from addon.live import sessions

    bpy.context.view_layer.update()
    sessions.update(bpy.context, wait=WAIT, refined=refined)


@in_blender
def test_the_result_follows_moves_and_returns():
    import bpy
    import numpy as np
    import scenes
    from test_live import step

    from addon.live import sessions

    bar, _, moving = scenes.bar_with_handles()
    before = scenes.world_points(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"} and sessions.is_live(bar)
    result = bpy.data.objects["Bar_live"]
    assert np.abs(scenes.world_points(result) - before).max() < 1e-3
    moving.location.z += 0.4
    step()
    shift = scenes.world_points(result) - before
    assert np.abs(shift[before[:, 0] < -0.8]).max() < 0.1
    assert np.abs(shift[before[:, 0] > 0.8] - [0, 0, 0.4]).max() < 0.1
    step(refined=True)
    finer = scenes.world_points(result) - before
    assert 0 < np.abs(finer - shift).max() < 0.1
    scenes.activate(bar)
    bpy.ops.arapfields.reset_handle(all=True)
    step(refined=True)
    assert np.abs(scenes.world_points(result) - before).max() < 0.02


@in_blender
def test_off_restores_what_was_there():
    import bpy
    import scenes
    from test_live import step

    bar, _, moving = scenes.bar_with_handles()
    bar.display_type = "SOLID"

    def names():
        kinds = bpy.data.objects, bpy.data.meshes, bpy.data.collections
        return [sorted(kind.keys()) for kind in kinds]

    before = scenes.everything(bar), names()
    bpy.ops.arapfields.live()
    assert bar.display_type == "BOUNDS"
    moving.location.z += 0.4
    step()
    moving.location.z -= 0.4
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert before == (scenes.everything(bar), names())
    assert bar.display_type == "SOLID" and not bar.arapfields.results


@in_blender
def test_a_live_shape_can_be_kept():
    import bpy
    import numpy as np
    import scenes
    from test_live import step

    bar, _, moving = scenes.bar_with_handles()
    scenes.decorate(bar)
    whole = scenes.everything(bar)
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step()
    shown = scenes.world_points(bpy.data.objects["Bar_live"])
    scenes.activate(bar)
    assert bpy.ops.arapfields.live_keep() == {"FINISHED"}
    assert "Bar_live" not in bpy.data.objects and bar.display_type == "TEXTURED"
    kept = bpy.data.objects["Bar_deformed"]
    assert np.abs(scenes.world_points(kept) - shown).max() < 0.1
    assert scenes.everything(kept) == whole


@in_blender
def test_several_objects_are_live_at_once():
    import bpy
    import numpy as np
    import scenes
    from test_live import step

    pairs = [scenes.bar_with_handles(name) for name in ("One", "Two")]
    for bar, _, _ in pairs:
        scenes.activate(bar)
        bpy.ops.arapfields.live()
    rest = [scenes.world_points(bpy.data.objects[f"{name}_live"]) for name in ("One", "Two")]
    pairs[0][2].location.z += 0.3
    pairs[1][2].location.z -= 0.3
    step()
    for name, before, sign in zip(("One", "Two"), rest, (1, -1), strict=True):
        moved = scenes.world_points(bpy.data.objects[f"{name}_live"]) - before
        assert np.abs(moved[before[:, 0] > 0.9][:, 2].mean() - 0.3 * sign) < 0.05


@in_blender
def test_a_new_handle_sets_the_solver_up_again():
    import bpy
    import scenes
    from test_live import step

    from addon.live import sessions

    bar, _, _ = scenes.bar_with_handles()
    bpy.ops.arapfields.live()
    scenes.activate(bar)
    bpy.ops.arapfields.add_handle()
    step()
    assert sessions.is_live(bar) and len(sessions.live[bar.session_uid].layout[0]) == 3
    for _ in range(3):
        scenes.activate(bar)
        bpy.ops.arapfields.remove_handle()
    step()
    assert not sessions.is_live(bar) and "Bar_live" not in bpy.data.objects


@in_blender
def test_playback_is_followed():
    import bpy
    import numpy as np
    import scenes
    from test_live import step

    bar, _, moving = scenes.bar_with_handles()
    for frame, height in ((1, 0.0), (9, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    right, heights = scenes.world_points(bar)[:, 0] > 0.9, []
    for frame in (1, 5, 9):
        bpy.context.scene.frame_set(frame)
        step()
        heights.append(scenes.world_points(bpy.data.objects["Bar_live"])[right][:, 2].mean())
    assert abs(heights[0]) < 0.02 and abs(heights[2] - 0.4) < 0.05 and np.all(np.diff(heights) > 0.1)


@in_blender
def test_loading_a_file_ends_live_mode_and_cleans_what_was_saved_of_it():
    import tempfile

    import bpy
    import scenes

    from addon.live import sessions

    bar, *_ = scenes.bar_with_handles()
    bar.display_type = "WIRE"
    bpy.ops.arapfields.live()
    path = tempfile.mktemp(suffix=".blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not sessions.live
    bpy.ops.wm.open_mainfile(filepath=path)
    assert "Bar_live" not in bpy.data.objects
    bar = bpy.data.objects["Bar"]
    assert bar.display_type == "WIRE" and not bar.arapfields.results


@in_blender
def test_what_cannot_be_live_is_named():
    import bpy
    import pytest
    import scenes

    scenes.bar()
    with pytest.raises(RuntimeError, match="Bar has no handle"):
        bpy.ops.arapfields.live()
    with pytest.raises(RuntimeError, match="not live"):
        bpy.ops.arapfields.live_keep()
