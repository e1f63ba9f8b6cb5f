# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown is a function of what the file says: by a short walk, and by what hands once found."""

import functools

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.pins import pin

    from addon.live import sessions
    from addon.pin_tool import drag
    from tests.blender.walk import world
    from tests.blender.walk.rule import Walk

pytestmark = pytest.mark.in_blender

OFF = 5e-3  # of the size, that a live shape may be off its fresh solve, and a release may change


def few_centers(test):
    """Solves take milliseconds."""

    @functools.wraps(test)
    def wrapped(*given):
        end = world.few_centers()
        try:
            test(*given)
        finally:
            end()

    return wrapped


@few_centers
def test_a_walk():
    """The long one: `python -m tests.blender.walk`."""
    walk, taken = Walk(4, 1e-5), 0
    while taken < 40:
        taken += walk.step()


def push(message):
    bpy.ops.ed.undo_push(message=message)


def undo_begins():
    bpy.context.preferences.edit.use_global_undo = True
    push("begin")


@few_centers
def test_an_import_with_its_rotation_comes_back_as_stored():
    bar = scenes.bar()
    bar.rotation_euler.x = np.pi / 2
    bpy.context.view_layer.update()
    undo_begins()
    pin(bar, (-1.0, 0.0, 0.25), anchor=True)
    push("anchor")
    pin(bar, (1.0, 0.0, 0.25), target=(0.7, 0.2, 0.9))
    push("drag")
    stored = scenes.world_points(bar)
    for again in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        again()
        again()
    scenes.activate(bpy.data.objects["Bar"])
    bpy.ops.arapfields.live()
    push("live")
    for message in ("first", "second"):
        bpy.data.objects["Bar"].arapfields.handles[1].empty.location.z += 0.1
        step(refined=True)
        push(message)
    bpy.ops.ed.undo()
    bpy.ops.ed.undo()
    world.settle()
    assert world.difference(scenes.world_points(bpy.data.objects["Bar"]), stored) < OFF


@few_centers
def test_a_pin_moved_by_g_and_its_undo_take_the_mesh_along():
    bar = scenes.bar()
    undo_begins()
    pin(bar, (-1.0, 0.0, 0.25), anchor=True)
    name = pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.4)).name
    push("drag")
    for height in (0.6, 0.8, 1.0):
        bpy.data.objects[name].location.z = height
        push("G")  # before the timer has come round
        world.settle()
    for again, height in ((bpy.ops.ed.undo, 0.8), (bpy.ops.ed.undo, 0.6), (bpy.ops.ed.redo, 0.8)):
        again()
        world.settle()
        bar = bpy.data.objects["Bar"]
        assert abs(bpy.data.objects[name].location.z - height) < 1e-6
        assert world.difference(world.shape(bar), world.fresh_shape(bar, "DEFORM")) < OFF


@few_centers
def test_each_live_style_is_that_of_the_settings_and_strength_0_is_rest():
    """On a thin open shell, on which one style after another once piled up."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=16, y_subdivisions=16)
    shell, style = bpy.context.object, bpy.context.object.arapfields.stylize
    points = np.array([vertex.co for vertex in shell.data.vertices])
    points[:, 2] = 0.4 * np.cos(2 * points[:, 0])
    scenes.set_positions(shell.data, points)
    rest = world.shape(shell)
    bpy.ops.arapfields.live(kind="STYLIZE")
    bpy.ops.mesh.primitive_cube_add(size=1, location=(5, 0, 0), rotation=(0.5, 0.3, 0))
    style.style, style.style_object = "OBJECT", bpy.context.object
    for name in ("OBJECT", "ICOSAHEDRON", "CYLINDER"):
        style.style = name
        step(refined=True)
        assert world.difference(world.shape(shell), world.fresh_shape(shell, "STYLIZE")) < OFF, name
    style.strength = 0.0
    step(refined=True)
    assert sessions.is_live(shell) and np.array_equal(world.shape(shell), rest)


def test_a_release_changes_nothing_that_is_seen():
    bar = scenes.bar(length=3.0)
    for x, y in ((-3.0, -0.25), (-3.0, 0.25), (0.0, -0.25)):
        pin(bar, (x, y, -0.25), 0.1, anchor=True)
    dragged = drag.of_new_pin(bpy.context, bar, np.array([3.0, 0.25, -0.25]), 0.1)
    start = np.array(dragged.empty.get().location)
    for share in (0.25, 0.5, 0.75, 1.0):
        dragged.move(bpy.context, start + share * np.array([-1.2, 0.3, 1.6]))
        step()
    shown = scenes.world_points(bar)
    dragged.end(bpy.context)
    bpy.context.view_layer.update()
    assert world.difference(scenes.world_points(bar), shown) < OFF
    assert world.difference(world.shape(bar), world.fresh_shape(bar, "DEFORM")) < 1e-5
