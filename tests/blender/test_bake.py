# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking animated handles into shape keys, and leaving it half done."""

import os
import tempfile

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import EXACT, animated, at, cancelled_at, solved, stepped
    from support.blender.riders import rider

    from addon.animation import caches
    from addon.blender.actions import curves_of
    from addon.core.runtime import jobs
    from addon.solver.frame_solver import FrameSolver

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


def test_frames_in_which_nothing_moves_are_solved_once():
    animated()
    solve, solved = FrameSolver.solve_from_rest, []

    def counted(solver, request, task=None):
        solved.append(request)
        return solve(solver, request, task)

    FrameSolver.solve_from_rest = counted
    try:
        bpy.ops.arapfields.bake(format="KEYS", start=-3, end=20)
    finally:
        FrameSolver.solve_from_rest = solve
    baked = bpy.data.objects["Bar_baked"]
    assert len(solved) == 5 and len(baked.data.shape_keys.key_blocks) == 25
    shapes = [at(baked, frame) for frame in (-3, 1, 4, 5, 20)]
    assert np.array_equal(shapes[0], shapes[1]) and np.array_equal(shapes[3], shapes[4])
    assert np.abs(shapes[3] - shapes[2]).max() > 0.02


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


@pytest.mark.parametrize("format", ["PC2", "KEYS"])
def test_a_cancelled_bake_leaves_an_earlier_one_and_what_is_carried(format):
    """Cancelled while keyframes of what is carried are stored, which comes last."""
    animated()
    items = [rider(kind) for kind in ("MESH", "CURVE", "EMPTY", "ARMATURE")]
    scenes.activate(*items, bpy.data.objects["Bar"])
    bpy.ops.arapfields.carry()
    folder = tempfile.mkdtemp()

    def state():
        objects, layer = bpy.data.objects, bpy.context.view_layer
        return (
            [sorted(kind.keys()) for kind in (objects, bpy.data.meshes, bpy.data.shape_keys)],
            [[m.name for m in item.modifiers] for item in objects],
            {action.name: [len(c.keyframe_points) for c in curves_of(action)] for action in bpy.data.actions},
            [(tuple(item.delta_location), item.hide_get(), item.select_get()) for item in objects],
            [tuple(bone.matrix_basis.translation) for bone in objects["Tail"].pose.bones],
            layer.objects.active.name,
            sorted(os.listdir(folder)),
        )

    def cancelled(frame):
        scenes.activate(bpy.data.objects["Bar"])
        before = state()
        operator = stepped(format=format, start=1, end=5, folder=folder)
        assert cancelled_at(operator, f"Storing frame {frame}") == {"CANCELLED"}
        bpy.context.view_layer.update()
        assert operator.said == "Bake cancelled" and state() == before

    cancelled(1)
    cancelled(3)
    assert bpy.ops.arapfields.bake(format=format, start=1, end=3, folder=folder) == {"FINISHED"}
    cancelled(3)
    seen = bpy.data.objects["Bar_baked" if format == "KEYS" else "Bar"]
    assert np.ptp([at(seen, frame)[:, 2].max() for frame in (1, 3)]) > 0.1


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


@pytest.mark.parametrize("new", [200, 50])
@pytest.mark.parametrize("format", ["PC2", "MDD", "KEYS"])
def test_a_bake_plays_at_the_scenes_frames_also_where_these_are_remapped(format, new, tmp_path):
    """Keys from frame 1 to 5 take twice as long, frames 2 to 10, or half as long, 0.5 to 2.5."""
    bar, render, path = animated(), bpy.context.scene.render, ""
    render.frame_map_old, render.frame_map_new = 100, new
    expected = {frame: solved(bar, frame) for frame in (2, 3)}
    cord = rider("CURVE")
    scenes.activate(cord, bar)
    bpy.ops.arapfields.carry()
    if format != "KEYS":
        path = str(tmp_path / f"bar.{format.lower()}")
    bar.arapfields.bake.range = "HANDLES"
    assert bpy.ops.arapfields.bake(format=format, filepath=path) == {"FINISHED"}
    played = bar if path else bpy.data.objects["Bar_baked"]
    for frame, points in expected.items():
        assert np.abs(at(played, frame) - points).max() < EXACT
        values = {key.name.split()[-1]: key.value for key in cord.data.shape_keys.key_blocks[1:]}
        assert values.pop(str(frame)) == 1.0 and not any(values.values())
    assert len(values) == (8 if new == 200 else 3)
