# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo, redo and reload: what is shown follows from what the file says."""

import contextlib
import functools
import math

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import pin, step

    from addon.core.errors import UserError
    from addon.field_modifier import layers
    from addon.live import live_solver, sessions
    from addon.pin_tool import drag, operators
    from tests.blender.walk import world

pytestmark = pytest.mark.in_blender

# Undo and redo beside live objects: what modifiers refer to is in the step that comes back.

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


def few_centers(test):
    """Solves take milliseconds."""

    @functools.wraps(test)
    def wrapped(*given, **named):
        end = world.few_centers()
        try:
            test(*given, **named)
        finally:
            end()

    return wrapped


def build():
    bpy.context.preferences.edit.use_global_undo = True
    bpy.context.preferences.edit.undo_steps = 64
    for number, kind in enumerate(("MIRROR", "SUBSURF", None)):
        bar = world.bar(np.random.default_rng(0), f"Bar{number}", (0, 3 * number, 0), handles=False)
        if kind is not None:
            bar.modifiers.new(kind.title(), kind)
            bpy.context.view_layer.update()
        world.give_handles(bar)
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
@few_centers
def test_undo_meets_no_reference_to_what_is_gone(walk):
    build()
    bpy.ops.ed.undo_push(message="begin")
    for step in walk.split():
        if step in ("undo", "redo"):
            getattr(bpy.ops.ed, step)()
        else:
            take(step[:-1], bpy.data.objects[f"Bar{step[-1]}"])
            bpy.ops.ed.undo_push(message=step)  # what timers do comes after the step
        assert not world.dangling()
        world.settle()
        assert not world.dangling()


@few_centers
def test_live_mode_that_ended_by_an_error_comes_back_by_undo():
    """Its end is a step of undo by itself; the step before is live, though its handle is gone already."""
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


@few_centers
@pytest.mark.parametrize("mend", ["handle", "mesh"])
def test_live_mode_that_waits_goes_on_once_what_is_wrong_is_mended(mend):
    """Undo has gone to a step in which it ended by an error; later steps show what it makes of them."""
    build()
    bar = bpy.data.objects["Bar2"]
    take("live", bar)
    bpy.ops.ed.undo_push(message="live")
    world.settle()
    if mend == "handle":
        for empty in [entry.empty for entry in bar.arapfields.handles]:
            bpy.data.objects.remove(empty)
    else:
        bar.data.vertices[0].co.x = math.nan
    bpy.ops.ed.undo_push(message="wrong")
    world.settle()
    bpy.ops.ed.undo()
    world.settle()
    bar = bpy.data.objects["Bar2"]
    assert bar.arapfields.live_kind and not sessions.is_live(bar)
    for _ in range(3):  # without a change it is not tried again and again
        bpy.context.view_layer.update()
        assert not sessions.live.returning
        sessions.update(bpy.context)
    if mend == "handle":
        handle = scenes.cube_empty(scenes.world_points(bar)[0], (0.4, 0.4, 0.4))
        scenes.activate(handle, bar)
        assert bpy.ops.arapfields.add_handle() == {"FINISHED"}
    else:
        bar.data.vertices[0].co.x = bar.data.vertices[1].co.x
    world.settle()
    assert sessions.is_live(bar)
    shown = scenes.world_points(bar)
    bpy.ops.ed.undo_push(message="mended")
    bpy.ops.ed.undo_push(message="another step")
    bpy.ops.ed.undo()
    world.settle()
    bar = bpy.data.objects["Bar2"]
    assert sessions.is_live(bar) and np.array_equal(scenes.world_points(bar), shown)


@few_centers
@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("name", ["Bar0", "Bar2"])
def test_a_duplicate_keeps_its_shape_whatever_the_live_original_does(name, linked):
    """Also where modifiers make vertices or the mesh is shared, so that offsets lie on a helper."""
    build()
    bar = bpy.data.objects[name]
    take("live", bar)
    world.settle()
    bpy.ops.ed.undo_push(message="live")
    scenes.activate(bar)
    bpy.ops.object.duplicate(linked=linked)
    copy = bpy.context.object.name
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="duplicated")
    world.settle()
    shown = scenes.world_points(bpy.data.objects[copy])

    def stays():
        world.settle()
        assert not world.dangling()
        assert np.array_equal(scenes.world_points(bpy.data.objects[copy]), shown)

    for way in (0.3, -0.2):
        bpy.data.objects[name].arapfields.handles[1].empty.location.z += way
        bpy.context.view_layer.update()
        bpy.ops.ed.undo_push(message="moved")
        stays()
    for step in ("undo", "undo", "redo", "redo", "undo"):
        getattr(bpy.ops.ed, step)()
        stays()
        assert sessions.is_live(bpy.data.objects[name])


@few_centers
def test_a_live_object_of_its_own_comes_back_by_undo():
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


@few_centers
def test_a_live_object_behind_its_extracted_surface_stays_hidden_under_undo():
    """Live mode begins anew with each change of what is carried, and hides and shows nothing then."""
    build()
    bar = bpy.data.objects["Bar2"]
    bar.arapfields.resolution = 12
    take("live", bar)
    bpy.ops.ed.undo_push(message="live")
    world.settle()
    scenes.activate(bar)
    assert bpy.ops.arapfields.extract() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="extract")
    world.settle()
    scenes.activate(bpy.data.objects["Bar2_implicit"], bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="carry")
    world.settle()
    assert bar.hide_get() and not bpy.data.objects["Bar2_implicit"].hide_get()
    bpy.ops.ed.undo()
    world.settle()
    assert bpy.data.objects["Bar2"].hide_get() and not bpy.data.objects["Bar2_implicit"].hide_get()


@few_centers
def test_a_shape_held_by_an_anchor_is_in_the_step_of_the_press():
    world.build_shapes()
    ball = bpy.data.objects["Ball"]
    scenes.activate(ball)
    assert bpy.ops.arapfields.live(kind="STYLIZE") == {"FINISHED"}
    world.settle()
    ball.arapfields.stylize.use_handles = True
    world.settle()
    shown = scenes.world_points(ball)
    pin(ball, shown[0], 0.3, anchor=True)
    bpy.ops.ed.undo_push(message="anchor")
    assert ball.arapfields.held  # before any timer
    world.settle()
    bpy.ops.ed.undo_push(message="another step")
    bpy.ops.ed.undo()
    world.settle()
    assert np.array_equal(scenes.world_points(bpy.data.objects["Ball"]), shown)


@few_centers
def test_live_mode_that_is_refused_leaves_what_the_file_says():
    """Also where the user has removed the modifier whose motion had a name."""
    build()
    bar = bpy.data.objects["Bar2"]
    take("deform", bar)
    bar.modifiers.remove(bar.modifiers["ARAP Fields"])
    bar.arapfields.handles[0].weight = 0.0
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="weight"):
        bpy.ops.arapfields.live()
    assert bar.arapfields.moved_by == "DEFORM" and not bar.arapfields.live_kind


@few_centers
def test_a_shape_comes_back_by_undo_after_its_helper_was_emptied():
    """Without the modifier the offsets lie on the mesh, and the helper's own are gone, which no step has."""
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


# What is shown is a function of what the file says: what hands and walks (tests/fuzz/walk) once found.

OFF = 5e-3  # of the size, that a live shape may be off its fresh solve, and a release may change
NO_MOTION = 1e-30  # where a coordinate is 0, a solve that ends at rest leaves its rounding


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
    assert sessions.is_live(shell) and np.abs(world.shape(shell) - rest).max() < NO_MOTION


@few_centers
def test_a_pose_has_one_digest_wherever_its_session_began():
    bar = scenes.bar()
    empty = pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.4))
    found = set()
    for height in (0.4, 0.7):
        empty.location.z = height
        sessions.begin(bpy.context, bar)
        empty.location.z = 0.5
        step()
        session = sessions.live[bar.session_uid]
        found.add(session.digest(session.reader.request(bpy.context)))
    assert len(found) == 1


@few_centers
def test_presses_and_cancelled_drags_of_a_live_style():
    """A cancelled one leaves the style live; what a press holds ends with the mode that shows it."""
    bar = scenes.bar()
    entry = pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.4)).name
    entry = next(one for one in bar.arapfields.handles if one.empty.name == entry)
    bpy.ops.arapfields.live(kind="STYLIZE")
    world.settle()
    styled = scenes.world_points(bar)
    dragged = drag.of_entry(bpy.context, bar, entry)
    dragged.move(bpy.context, (0.9, 0.1, 0.6))
    dragged.cancel(bpy.context)
    world.settle()
    assert sessions.is_live(bar, "STYLIZE") and np.array_equal(scenes.world_points(bar), styled)
    drag.of_entry(bpy.context, bar, entry).end(bpy.context)
    world.settle()
    assert np.array_equal(scenes.world_points(bar), styled)
    for kind in ("STYLIZE", "DEFORM"):
        bpy.ops.arapfields.live(kind=kind)
        world.settle()
        assert world.difference(world.shape(bar), world.fresh_shape(bar, kind)) < 1e-5


@few_centers
@pytest.mark.parametrize("lacks", ["style_object", "handle"])
def test_a_style_that_waits_for_what_is_to_be_chosen_comes_back(lacks):
    ball = scenes.bar()
    style = ball.arapfields.stylize
    undo_begins()
    bpy.ops.arapfields.live(kind="STYLIZE")
    push("live")
    if lacks == "handle":
        style.use_handles = True
    else:
        style.style = "OBJECT"
    push("waits")
    stored = world.everything()
    bpy.ops.arapfields.live(kind="STYLIZE")
    push("off")
    bpy.ops.ed.undo()
    world.settle()
    assert sessions.is_live(bpy.data.objects["Bar"]) and world.everything() == stored


@few_centers
@pytest.mark.parametrize("comes_back", [False, True])
def test_a_press_where_a_style_waits_for_its_object_holds_what_is_shown(comes_back):
    """Also after live mode was ended, and that was undone."""
    bpy.context.preferences.edit.use_global_undo = True
    bar = scenes.bar()
    pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.4))
    bpy.ops.arapfields.live(kind="STYLIZE")
    world.settle()
    shown = scenes.world_points(bar)
    bar.arapfields.stylize.style = "OBJECT"
    if comes_back:
        bpy.ops.ed.undo_push(message="waits")
        bpy.ops.arapfields.live(kind="STYLIZE")
        bpy.ops.ed.undo_push(message="ended")
        bpy.ops.ed.undo()
        world.settle()
        bar = bpy.data.objects["Bar"]
        assert np.array_equal(scenes.world_points(bar), shown)
    drag.of_entry(bpy.context, bar, bar.arapfields.handles[0]).end(bpy.context)
    world.settle()
    assert np.array_equal(scenes.world_points(bar), shown)


@few_centers
def test_a_step_comes_back_live_however_many_sessions_later():
    bar = scenes.bar()
    undo_begins()
    bpy.ops.arapfields.live(kind="STYLIZE")
    world.settle()
    push("live")
    stored = world.everything()
    for _ in range(25):  # as undone and redone steps, and changed handles, begin them
        sessions.begin(bpy.context, bar, "STYLIZE")
    push("other")
    bpy.ops.ed.undo()
    world.settle()
    assert sessions.is_live(bpy.data.objects["Bar"]) and world.everything() == stored


@pytest.mark.parametrize("rests", [False, True])
def test_a_release_changes_nothing_that_is_seen(rests):
    """The hand goes fast, or rests until the shape is refined; each move is seen in the same picture.

    The fast hand goes half as far: the more a drag bends, the more its shape depends on the steps that the
    worker had time for. Half as far, 32 drags beside busy processors were off by at most .0028.
    """
    way = np.array([-1.2, 0.3, 1.6]) if rests else np.array([-0.6, 0.15, 0.8])
    bar = scenes.bar(length=3.0)
    for x, y in ((-3.0, -0.25), (-3.0, 0.25), (0.0, -0.25)):
        pin(bar, (x, y, -0.25), 0.1, anchor=True)
    dragged = drag.of_new_pin(bpy.context, bar, np.array([3.0, 0.25, -0.25]), 0.1)
    start = np.array(dragged.empty.get().location)
    limits, drag.SHAPE_WAIT, live_solver.LATEST = (drag.SHAPE_WAIT, live_solver.LATEST), 30.0, 30.0
    for share in np.linspace(0, 0.9, 10)[1:]:
        dragged.move(bpy.context, start + share * way)
        if rests and share < 0.85:
            dragged.session().worker.wait(30.0, refined=True)
    drag.SHAPE_WAIT, live_solver.LATEST = limits
    shown = scenes.world_points(bar)
    dragged.end(bpy.context)
    bpy.context.view_layer.update()
    assert world.difference(scenes.world_points(bar), shown) < OFF
    assert world.difference(world.shape(bar), world.fresh_shape(bar, "DEFORM")) < 1e-5


def test_undo_goes_past_a_step_in_which_live_mode_fails():
    """It fails anew there, which is no step of its own: undo would come back to it each time."""
    bar, _, _ = scenes.bar_with_handles()
    bar.modifiers.new("Smooth", "SUBSURF")
    bpy.ops.ed.undo_push(message="bar")
    bpy.ops.arapfields.live()
    step(refined=True)
    bpy.ops.ed.undo_push(message="live")
    far = scenes.cube_empty((9.0, 0.0, 0.0), (0.3, 0.6, 0.6))
    bpy.context.view_layer.update()
    scenes.activate(far, bar)
    bpy.ops.arapfields.add_handle(kind="POINT")  # too far off, as the worker finds
    bpy.ops.ed.undo_push(message="handle")
    step(refined=True)
    assert not sessions.live  # its end is a step
    for _ in range(2):
        bpy.ops.ed.undo()
        sessions.update(bpy.context)  # as the timer does, before there is a shape
        step(refined=True)
    bar = bpy.data.objects["Bar"]
    assert len(bar.arapfields.handles) == 2 and sessions.is_live(bar)


def move_another(name):
    """Three steps of undo; what they do not change stays in memory, as it is, when the last one is undone."""
    for _ in range(3):
        bpy.data.objects[name].location.z += 1.0
        bpy.context.view_layer.update()
        push("another object")


def put_far_off(handle):
    """The handle rests too far from the surface, which the worker finds."""
    handle.kind = "POINT"
    handle.empty.location.x -= 50.0
    assert bpy.ops.arapfields.set_rest(all=True) == {"FINISHED"}


@pytest.mark.parametrize("way", ["live", "drag", "new pin"])
@few_centers
def test_what_is_refused_or_cancelled_leaves_no_new_data_without_a_step(way):
    """A duplicate shares the helper; live mode makes one of its own, which stays at the modifier."""
    build()
    bar = bpy.data.objects["Bar0"]
    take("deform", bar)
    take("duplicate", bar)
    scenes.activate(bar)
    handle = bar.arapfields.handles[0]
    if way == "live":
        put_far_off(handle)
    move_another("Bar2")
    if way == "live":
        with pytest.raises(RuntimeError, match="live mode ended"):
            bpy.ops.arapfields.live()
    elif way == "drag":
        drag.of_entry(bpy.context, bar, handle).cancel(bpy.context)
    else:
        drag.of_new_pin(bpy.context, bar, scenes.world_points(bar)[0], 0.2).cancel(bpy.context)
    assert not world.dangling() and not sessions.live
    for _ in range(2):
        bpy.ops.ed.undo()
        assert not world.dangling()


@pytest.mark.parametrize("what", ["deform", "handle"])
@few_centers
def test_what_fails_on_a_style_leaves_no_new_data_without_a_step(what):
    """The style that it would have acted on comes back with a helper of its own: its mesh is shared."""
    build()
    bar = bpy.data.objects["Bar2"]
    scenes.activate(bar)
    assert bpy.ops.arapfields.stylize() == {"FINISHED"}
    bpy.ops.object.duplicate(linked=True)
    scenes.activate(bar)
    handle = bar.arapfields.handles[0]
    put_far_off(handle)
    move_another("Bar0")
    if what == "deform":
        with pytest.raises(RuntimeError, match="away from it"):
            bpy.ops.arapfields.deform()
    else:
        with pytest.raises(UserError), layers.way_for_handle(bpy.context, bar):
            raise UserError("refused")
    assert not world.dangling()
    for _ in range(2):
        bpy.ops.ed.undo()
        assert not world.dangling()


@few_centers
def test_undo_of_live_mode_on_a_style_of_a_copy_gives_the_style():
    """The copy's mesh still has the mark of the live shape of which it is the copy of a copy."""
    build()
    bar = bpy.data.objects["Bar2"]
    take("live", bar)
    push("live")
    world.settle()
    for linked in (True, False):
        for entry in bar.arapfields.handles if not linked else ():
            entry.empty.select_set(True)
        bpy.ops.object.duplicate(linked=linked)
        push("duplicate")
        world.settle()
    copied = bpy.context.object
    assert bpy.ops.arapfields.stylize() == {"FINISHED"}
    push("stylize")
    world.settle()
    shown = scenes.world_points(copied)
    name = copied.name
    take("live", copied)
    push("live")
    world.settle()
    bpy.ops.ed.undo()
    world.settle()
    assert np.array_equal(scenes.world_points(bpy.data.objects[name]), shown)


@few_centers
def test_a_turn_of_a_pin_that_is_cancelled_is_no_data_without_a_step():
    """Live mode begins with it, and goes on."""
    build()
    bar = bpy.data.objects["Bar0"]
    move_another("Bar2")
    scenes.activate(bar.arapfields.handles[0].empty)
    with contextlib.suppress(RuntimeError):  # without a window there is no turn by the mouse
        operators.ARAPFIELDS_OT_pin_turn.invoke(None, bpy.context, None)
    assert sessions.live and not world.dangling()
    for _ in range(3):
        bpy.ops.ed.undo()
        assert not world.dangling()
