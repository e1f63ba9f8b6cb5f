# SPDX-License-Identifier: GPL-3.0-or-later
"""Users who edit the mesh that a job works on: results wait for the end of Edit Mode, or leave nothing."""

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes, stages

    from addon.core.runtime import jobs
    from addon.core.runtime.coroutines import Pause

pytestmark = pytest.mark.in_blender


def steps_until(coroutine, reached):
    """Steps it as a window does; what it returns, or None as soon as `reached()`."""
    for _ in range(100000):
        try:
            if next(coroutine) is Pause.WORKER:
                jobs.running().join(0.005)
        except StopIteration as ended:
            jobs.stop()
            return ended.value
        if reached():
            return None
    raise AssertionError(jobs.running().message)


def waits():
    return "is in Edit Mode; leave it first" in jobs.running().message


def edited():
    """(bar, coroutine) of a job that has its result while the bar is in Edit Mode."""
    stage = stages.Stage("job")
    bar, _ = stage.begin()
    stage.running.in_window = True
    scenes.activate(bar)
    bpy.ops.object.mode_set(mode="EDIT")
    assert steps_until(stage.coroutine, waits) is None
    return bar, stage.coroutine


def test_a_result_waits_for_the_end_of_edit_mode():
    bar, coroutine = edited()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert steps_until(coroutine, lambda: False) == {"FINISHED"}
    assert scenes.world_points(bar)[:, 2].max() > 0.4


def test_one_that_waits_is_cancelled():
    bar, coroutine = edited()
    jobs.running().cancel()
    assert steps_until(coroutine, lambda: False) == {"CANCELLED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not bar.modifiers and "ARAP Fields" not in bar.data.attributes


def subdivided(bar):
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")


def mirrored(bar):
    bar.modifiers.new("Mirror", "MIRROR").use_axis = (False, True, False)


def exchanged(bar):
    bar.data = bpy.data.meshes.new("Triangle")
    bar.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])


CHANGES = {"subdivided": subdivided, "mirrored": mirrored, "exchanged": exchanged} if IN_BLENDER else {}


@pytest.mark.parametrize("change", ["subdivided", "mirrored", "exchanged"])
def test_a_mesh_of_other_vertices_is_left_alone(change):
    stage = stages.Stage("job")
    bar, _ = stage.begin()
    scenes.activate(bar)
    CHANGES[change](bar)
    names = {item.name for item in bpy.data.objects}
    assert "changed while it was worked on" in stage.end()
    assert [m.type for m in bar.modifiers] == (["MIRROR"] if change == "mirrored" else [])
    assert "ARAP Fields" not in bar.data.attributes
    assert {item.name for item in bpy.data.objects} == names
