# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame's shape is the frame's alone, played, jumped to, baked or rendered; with secondary motion too."""

import tempfile
import time

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.scenes import camera
    from support.blender.stacks import local_points

    from addon.live import sessions

pytestmark = pytest.mark.in_blender

# A frame's shape is the frame's alone, played, jumped to, baked or rendered; styles that are animated.

PATIENCE = 600  # seconds for a frame, on however busy a machine
SAME = 1e-4  # of the object's size: the agreed limit; two solves of one request agree in every bit


def turning(frames=40):
    """A bar whose right end turns by 150° and rises from frame 1 to the last."""
    bar, _, moving = scenes.bar_with_handles()
    for frame, turn, height in ((1, 0.0, 0.0), (frames, 2.6, 0.3)):
        moving.rotation_euler.x, moving.location.z = turn, height
        moving.keyframe_insert("rotation_euler", frame=frame)
        moving.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)
    scenes.activate(bar)
    return bar


def styled():
    """A ball that becomes a cube from frame 1 to 40, and everything else of the style changes with it."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    axes = bpy.data.objects.new("Axes", None)
    bpy.context.collection.objects.link(axes)
    style = ball.arapfields.stylize
    style.frame, style.frame_object = "EMPTY", axes
    for frame, strength, sharpness, bending, turn in ((1, 0.1, 4.0, 0.01, 0.0), (40, 1.0, 9.0, 0.5, 1.0)):
        style.strength, style.sharpness, style.bending, axes.rotation_euler.z = (
            strength,
            sharpness,
            bending,
            turn,
        )
        for name in ("strength", "sharpness", "bending"):
            style.keyframe_insert(name, frame=frame)
        axes.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(1)
    return ball


def live_at(item, kind, frames):
    """(n, 3) what live mode shows when it has come by these frames, stepped as a window would."""
    bpy.context.scene.frame_set(1)
    bpy.context.view_layer.objects.active = item
    bpy.ops.arapfields.live(kind=kind)
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        sessions.update(bpy.context, wait=PATIENCE)
    sessions.update(bpy.context, wait=PATIENCE, refined=True)
    return local_points(item)


def every_way(item, kind):
    """{way: (n, 3) points of frame 37}."""
    scene, shapes = camera(8), {}
    for name, frames in (("played", range(34, 38)), ("back", [38, 37]), ("jumped", [37])):
        shapes[name] = live_at(item, kind, frames)
        bpy.ops.arapfields.live(kind=kind)
    live_at(item, kind, [30])
    scene.frame_start = scene.frame_end = 37
    scene.render.filepath = tempfile.mkdtemp() + "/frame"
    bpy.ops.render.render(animation=True)
    scene.frame_set(37)
    shapes["rendered"] = local_points(item)
    bpy.ops.arapfields.live(kind=kind)
    for start in (37, 1):
        path = f"{tempfile.mkdtemp()}/bake.pc2"
        bpy.ops.arapfields.bake(kind=kind, start=start, end=37, step=36, filepath=path)
        scene.frame_set(37)
        shapes[f"baked from {start}"] = local_points(item)
    return shapes


def test_a_frame_is_the_same_played_jumped_to_baked_and_rendered():
    bar = turning()
    shapes = every_way(bar, "DEFORM")
    size = np.ptp(shapes["jumped"], axis=0).max()
    for way, points in shapes.items():
        away = np.abs(points - shapes["jumped"]).max()
        assert away <= SAME * size, (way, away)


@pytest.mark.slow
def test_a_frame_of_an_animated_style_is_the_same_in_every_way():
    ball = styled()
    shapes = every_way(ball, "STYLIZE")
    for way, points in shapes.items():
        away = np.abs(points - shapes["jumped"]).max()
        assert away <= SAME * 2, (way, away)


@pytest.mark.slow
def test_every_animated_setting_of_a_style_changes_what_is_solved():
    """strength, sharpness, stiffness and orientation, each alone between two frames."""
    for name, values in (("strength", (0.2, 1.0)), ("sharpness", (1.0, 9.0)), ("bending", (0.001, 5.0))):
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
        ball = bpy.context.object
        style = ball.arapfields.stylize
        for frame, value in zip((1, 2), values, strict=True):
            setattr(style, name, value)
            style.keyframe_insert(name, frame=frame)
        path = f"{tempfile.mkdtemp()}/bake.pc2"
        assert bpy.ops.arapfields.bake(start=1, end=2, filepath=path) == {"FINISHED"}
        shapes = []
        for frame in (1, 2):
            bpy.context.scene.frame_set(frame)
            shapes.append(local_points(ball))
        assert np.abs(shapes[1] - shapes[0]).max() > 1e-3, name


def test_live_playback_keeps_solved_frames_and_tells_how_many():
    bar = turning()
    first = live_at(bar, "DEFORM", [10])
    frames = sessions.live[bar.session_uid].playback.frames
    for frame in (11, 12):
        bpy.context.scene.frame_set(frame)
        step(refined=True)
    solved = frames._solver.solver.report
    assert frames.count(1, 40) >= 3
    bpy.context.scene.frame_set(10)  # shown at once, without another solve
    assert np.array_equal(local_points(bar), first) and frames._solver.solver.report == solved
    moving = bpy.data.objects["Moving"]
    moving.location.y = 0.5
    moving.keyframe_insert("location", frame=10)
    bpy.context.scene.frame_set(10)
    step(refined=True)
    assert np.abs(local_points(bar) - first).max() > 0.1  # never a shape of another animation
    assert frames.count(1, 40) < 3


def test_a_frame_that_is_not_evaluated_yet_is_not_read():
    """In a window the timer of live mode may run between a jump to a frame and its evaluation."""
    item, scene = turning(8), bpy.context.scene
    bpy.ops.arapfields.live()
    for frame in (2, 3, 4, 1):
        scene.frame_set(frame)
        step(refined=True)
    first, frames = local_points(item), sessions.live[item.session_uid].playback.frames
    scene.frame_set(4)
    step(refined=True)
    before = frames.count(1, 8)
    scene.frame_current = 1  # as a jump does: evaluated later
    sessions.update(bpy.context, wait=PATIENCE, refined=True)
    assert frames.count(1, 8) == before == 4
    assert np.array_equal(local_points(item), first)


def test_a_drag_at_a_frame_goes_on_from_the_shape_at_hand():
    bar = turning()
    before = live_at(bar, "DEFORM", [20])
    session = sessions.live[bar.session_uid]
    assert session.solver.is_playing
    bpy.data.objects["Moving"].location.y += 0.2
    step(refined=True)
    assert not session.solver.is_playing
    shift = (local_points(bar) - before)[before[:, 0] > 0.9]
    assert np.abs(shift.mean(axis=0)[1] - 0.2) < 0.05


def test_a_window_that_comes_to_another_scene_shows_its_frame():
    bar, window = turning(), bpy.context.window
    one, other = bpy.context.scene, bpy.data.scenes.new("Other")
    for item in one.objects:
        other.collection.objects.link(item)
    other.frame_set(30)
    one.frame_set(15)
    sessions.begin(bpy.context, bar)
    heights = []
    for scene in (one, other, one):
        window.scene = scene
        step(refined=True)
        heights.append(scenes.world_points(bar)[:, 2].max())
    other.frame_set(15)
    window.scene = other
    step(refined=True)
    assert heights[0] == heights[2] == scenes.world_points(bar)[:, 2].max()
    assert abs(heights[1] - heights[0]) > 0.1


def test_live_mode_begun_in_another_scene_leaves_unkeyed_places_alone():
    bar, moving = turning(), bpy.data.objects["Moving"]
    sessions.begin(bpy.context, bar)
    step()
    sessions.end(bpy.context, bar)
    other = bpy.data.scenes.new("Other")
    for item in bpy.context.scene.objects:
        other.collection.objects.link(item)
    bpy.context.window.scene = other
    moving.location.z = 0.5
    bpy.context.view_layer.update()
    sessions.begin(bpy.context, bar)
    step(refined=True)
    assert moving.location.z == 0.5


# Secondary motion: playback and bakes make the same bits, drags settle, jumps begin at rest.


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
