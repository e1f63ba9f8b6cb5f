# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo and redo beside live objects: what modifiers refer to is in the step that comes back."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    from addon.live import sessions
    from tests.blender.walk import world
    from tests.fuzz.walk import all_scene

pytestmark = pytest.mark.in_blender

# Blender died in each of these.
WALKS = (
    "mirror0 live0 live1 deform0 undo undo redo",
    "mirror1 live1 live0 deform0 deform1 undo undo undo redo redo",
    "live1 subdivide1 undo undo redo redo",
    "live2 mirror2 first2 undo redo undo undo",
    "live2 share2 undo redo undo undo redo",
    "new2 live2 subdivide2 undo redo undo",
    "live2 carry2 undo redo undo undo redo redo",
    "live1 duplicate1 subdivide1 undo undo redo redo",
)


def build():
    bpy.context.preferences.edit.use_global_undo = True
    bpy.context.preferences.edit.undo_steps = 64
    for number, kind in enumerate(("MIRROR", "SUBSURF", None)):
        bar = all_scene.bar(np.random.default_rng(0), f"Bar{number}", (0, 3 * number, 0), handles=False)
        if kind is not None:
            bar.modifiers.new(kind.title(), kind)
            bpy.context.view_layer.update()
        all_scene.give_handles(bar)
    scenes.bar("Die").location.x = 5
    bpy.context.view_layer.update()


def take(what, bar):
    arapfields = bpy.ops.arapfields
    scenes.activate(bar)
    if what == "live":
        assert arapfields.live() == {"FINISHED"}
    elif what == "deform":
        assert arapfields.deform() == {"FINISHED"}
    elif what == "new":
        bar.arapfields.result = "NEW"
    elif what == "mirror":
        bar.modifiers.new("Mirrored", "MIRROR")
    elif what == "first":
        bar.modifiers.move(len(bar.modifiers) - 1, 0)
    elif what == "share":
        bpy.data.objects["Die"].data = bar.data
    elif what == "carry":
        scenes.activate(bpy.data.objects["Die"], bar)
        assert arapfields.carry() == {"FINISHED"}
    elif what == "duplicate":
        bpy.ops.object.duplicate()
    else:
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.subdivide()
        bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.parametrize("walk", WALKS)
def test_undo_meets_no_reference_to_what_is_gone(walk):
    end = world.few_centers()
    try:
        build()
        bpy.ops.ed.undo_push(message="begin")
        for step in walk.split():
            if step in ("undo", "redo"):
                getattr(bpy.ops.ed, step)()
            else:
                take(step[:-1], bpy.data.objects[f"Bar{step[-1]}"])
                bpy.ops.ed.undo_push(message=step)  # what timers do comes after the step
            assert not all_scene.dangling()
            world.settle()
            assert not all_scene.dangling()
    finally:
        end()


def test_live_mode_that_ended_by_an_error_comes_back_by_undo():
    """Its end is a step of undo by itself; the step before is live, though its handle is gone already."""
    end = world.few_centers()
    try:
        build()
        bar = bpy.data.objects["Bar2"]
        take("live", bar)
        bpy.ops.ed.undo_push(message="live")
        world.settle()
        shown = scenes.world_points(bar)
        for empty in [entry.empty for entry in bar.arapfields.handles]:
            bpy.data.objects.remove(empty)
        bpy.ops.ed.undo_push(message="deleted")
        world.settle()
        assert not sessions.live and not bar.arapfields.live_kind
        for _ in range(2):
            bpy.ops.ed.undo()
            world.settle()
        bar = bpy.data.objects["Bar2"]
        assert sessions.is_live(bar) and np.array_equal(scenes.world_points(bar), shown)
    finally:
        end()


def test_a_live_object_of_its_own_comes_back_by_undo():
    end = world.few_centers()
    try:
        build()
        bar = bpy.data.objects["Bar2"]
        take("new", bar)
        take("live", bar)
        bpy.ops.ed.undo_push(message="live")
        world.settle()
        shown = scenes.world_points(bpy.data.objects["Bar2_live"])
        scenes.activate(bar)
        assert bpy.ops.arapfields.live() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="off")
        assert "Bar2_live" not in bpy.data.objects and not bar.hide_render
        bpy.ops.ed.undo()
        world.settle()
        bar = bpy.data.objects["Bar2"]
        assert sessions.is_live(bar) and bar.hide_render
        assert np.array_equal(scenes.world_points(bpy.data.objects["Bar2_live"]), shown)
    finally:
        end()


def test_a_shape_comes_back_by_undo_after_its_helper_was_emptied():
    """Without the modifier the offsets lie on the mesh, and the helper's own are gone, which no step has."""
    end = world.few_centers()
    try:
        build()
        bar = bpy.data.objects["Bar0"]
        bar.modifiers["Mirror"].show_viewport = False
        take("live", bar)
        world.settle()
        bpy.ops.ed.undo_push(message="live")
        world.settle()
        shown = scenes.world_points(bar)
        bar.modifiers.remove(bar.modifiers["Mirror"])
        bpy.ops.ed.undo_push(message="removed")
        world.settle()
        bpy.ops.ed.undo()
        world.settle()
        bar = bpy.data.objects["Bar0"]
        assert sessions.is_live(bar) and np.array_equal(scenes.world_points(bar), shown)
    finally:
        end()
