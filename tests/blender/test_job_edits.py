# SPDX-License-Identifier: GPL-3.0-or-later
"""Users who edit the mesh that a job works on: results wait for the end of Edit Mode, or leave nothing."""

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes, stages

    from addon.core.errors import UserError
    from addon.core.runtime import jobs
    from addon.core.runtime.coroutines import Pause
    from addon.field_modifier import inputs
    from addon.results import placement

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


def shown_first():
    """The bar, its job's coroutine, and the preview, which shows the first shape."""
    stage = stages.Stage("window")
    bar, _ = stage.begin()
    operator = stage.operator()
    operator.in_window = True
    stage.start(operator)
    preview = jobs.running().items[0].preview
    preview.show(preview.points.astype("f4"))
    return bar, stage.coroutine, preview


@pytest.mark.parametrize("ends", ["FINISHED", "CANCELLED"])
def test_a_result_takes_the_modifier_that_a_first_shape_made(ends):
    """Its inputs may be in the user's hands: Blender crashed when it went."""
    bar, coroutine, preview = shown_first()
    inputs.put(bar.modifiers[0], "Factor", 0.5)
    if ends == "CANCELLED":
        jobs.running().cancel()
    assert steps_until(coroutine, lambda: False) == {ends}
    preview.clear()  # as the window's display does in the end
    if ends == "CANCELLED":
        assert not bar.modifiers
        return
    assert len(bar.modifiers) == 1 and inputs.get(bar.modifiers[0], "Factor") == 0.5
    inputs.put(bar.modifiers[0], "Factor", 1.0)
    bpy.context.view_layer.update()
    shown = scenes.world_points(bar)
    bpy.ops.arapfields.remove_field()
    bpy.ops.arapfields.deform(**scenes.QUICK)
    assert (scenes.world_points(bar) == shown).all()


def test_a_first_shape_goes_where_its_result_is_refused():
    bar, coroutine, preview = shown_first()

    def refuse(*given):
        raise UserError("no")

    places, placement.place_result = placement.place_result, refuse
    try:
        assert steps_until(coroutine, lambda: False) == {"CANCELLED"}
    finally:
        placement.place_result = places
    preview.clear()
    assert not bar.modifiers and "ARAP Fields" not in bar.data.attributes


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
