# SPDX-License-Identifier: GPL-3.0-or-later
"""Secondary motion: playback and bakes make the same bits, drags settle, jumps begin at rest."""

import tempfile
import time

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.stacks import local_points

    from addon.live import sessions

pytestmark = pytest.mark.in_blender


def nodding(frames=6):
    """A bar of which one end is held and moves up, and then holds still; the other swings."""
    bar, held, moving = scenes.bar_with_handles()
    bpy.data.objects.remove(moving)
    for frame, height in ((1, 0.0), (frames // 2, 0.5)):
        held.location.z = height
        held.keyframe_insert("location", frame=frame)
    bar.arapfields.secondary.use = True
    bpy.context.scene.frame_set(1)
    scenes.activate(bar)
    return bar


def live_shapes(bar, frames):
    """{frame: (n, 3)} of what live mode shows as the scene comes by these frames."""
    shapes = {}
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        sessions.update(bpy.context, wait=600)  # on however busy a machine
        shapes[frame] = local_points(bar)
    return shapes


def test_playback_and_bakes_are_the_same_bits():
    bar = nodding()
    rest = local_points(bar)
    assert bpy.ops.arapfields.live(kind="DEFORM") == {"FINISHED"}
    played = live_shapes(bar, range(1, 13))
    moved = [np.abs(played[frame] - rest).max() for frame in range(1, 13)]
    assert moved[0] < 1e-5 and max(moved) > 0.5  # at rest, and overshooting
    still = [np.abs(played[frame] - played[frame - 1]).max() for frame in range(8, 13)]
    assert max(still) > 1e-3, still  # it swings on while its handle holds still
    again = live_shapes(bar, (9, 5, 12))  # from what was kept
    assert all(np.array_equal(again[frame], played[frame]) for frame in again)
    bpy.ops.arapfields.live(kind="DEFORM")
    assert np.array_equal(local_points(bar), rest)
    for given in (
        {"start": 1, "end": 12},
        {"start": 7, "end": 11, "step": 2},
        {"start": 5, "end": 8, "subframes": 2},
    ):
        path = f"{tempfile.mkdtemp()}/bake.pc2"
        assert bpy.ops.arapfields.bake(kind="DEFORM", filepath=path, **given) == {"FINISHED"}
        for frame in range(given["start"], given["end"] + 1, given.get("step", 1)):
            bpy.context.scene.frame_set(frame)
            away = np.abs(local_points(bar) - played[frame]).max()
            assert away < 1e-6, (given, frame, away)


def test_a_jump_begins_at_rest_and_is_made_again_from_the_start():
    bar = nodding()
    bpy.ops.arapfields.live(kind="DEFORM")
    jumped = live_shapes(bar, (40,))[40]
    assert np.isfinite(jumped).all()
    played = live_shapes(bar, range(1, 9))
    bar.arapfields.secondary.damping = 20.0  # what is kept of other settings is not shown
    damped = live_shapes(bar, range(1, 9))
    assert np.abs(damped[8] - played[8]).max() > 1e-3
    bar.arapfields.secondary.damping = 3.0
    assert np.array_equal(live_shapes(bar, range(1, 9))[8], played[8])


def test_a_dragged_handle_lets_it_swing_and_settle():
    bar, held, moving = scenes.bar_with_handles()
    bpy.data.objects.remove(moving)
    bar.arapfields.secondary.use, bar.arapfields.secondary.damping = True, 6.0
    scenes.activate(bar)
    assert bpy.ops.arapfields.live(kind="DEFORM") == {"FINISHED"}
    before = local_points(bar)
    held.location.z += 0.4
    bpy.context.view_layer.update()
    shapes, end = [], time.monotonic() + 60
    session = sessions.live[bar.session_uid]
    while time.monotonic() < end:
        sessions.update(bpy.context)
        shapes.append(local_points(bar))
        if len(shapes) > 20 and session.worker.is_settled:
            break
        time.sleep(0.01)
    assert session.worker.is_settled  # and takes no more time
    far = before[:, 0] > 0.9
    heights = [shape[far, 2].mean() - before[far, 2].mean() for shape in shapes]
    assert max(heights) > 0.42  # it overshoots
    assert abs(heights[-1] - 0.4) < 0.03
    bpy.data.objects.remove(held)  # in the middle of it all
    sessions.update(bpy.context)
    bpy.ops.ed.undo_push(message="gone")
    assert np.isfinite(local_points(bar)).all()


def test_soft_parts_grounds_and_refusals():
    bar = nodding()
    ours = bar.arapfields.secondary
    ours.group = "Nowhere"
    with pytest.raises(RuntimeError, match="Nowhere"):
        bpy.ops.arapfields.live(kind="DEFORM")
    group = bar.vertex_groups.new(name="Soft")
    group.add([v.index for v in bar.data.vertices if v.co.x > 0], 1.0, "REPLACE")
    ours.group, ours.gravity, ours.use_ground, ours.ground = "Soft", 9.81, True, -0.3
    bpy.ops.arapfields.live(kind="DEFORM")
    shapes = live_shapes(bar, range(1, 6))
    assert shapes[5][:, 2].min() > -0.4
    path = f"{tempfile.mkdtemp()}/bake.pc2"
    with pytest.raises(RuntimeError, match="parts"):
        bpy.ops.arapfields.bake(kind="DEFORM", filepath=path, part=(1, 2))
    ours.use = False
    bpy.ops.arapfields.live(kind="DEFORM")


def test_a_baked_loop_closes_or_is_refused():
    bar = nodding(12)
    held = bpy.data.objects["Fixed"]
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="does not come back"):
        bpy.ops.arapfields.bake(
            kind="DEFORM", start=1, end=12, loop=True, filepath=tempfile.mkdtemp() + "/no.pc2"
        )
    held.location.z = 0.0
    held.keyframe_insert("location", frame=12)
    path = f"{tempfile.mkdtemp()}/loop.pc2"
    assert bpy.ops.arapfields.bake(kind="DEFORM", start=1, end=12, loop=True, filepath=path) == {"FINISHED"}
    shapes = []
    for frame in range(1, 13):
        bpy.context.scene.frame_set(frame)
        shapes.append(local_points(bar))
    size = np.ptp(shapes[0], axis=0).max()
    assert np.abs(shapes[-1] - shapes[0]).max() < 1e-6 * size
    assert np.abs(shapes[6] - shapes[0]).max() > 0.1  # and it moves meanwhile
