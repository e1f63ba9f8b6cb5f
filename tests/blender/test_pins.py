# SPDX-License-Identifier: GPL-3.0-or-later
"""The pin tool without a window: places, names, colours, and drags that are live and can be taken back."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import WAIT, step
    from support.blender.pins import pin, state

    from addon.core.geometry.rotations import best_rotation
    from addon.handles import left_behind
    from addon.live import sessions
    from addon.live.prefetch import prefetch
    from addon.pin_tool import drag

pytestmark = pytest.mark.in_blender

TOP = (0.0, 0.0, 0.25)  # on the bar


def test_the_first_drag_bends_and_what_is_far_holds():
    bar = scenes.bar()
    rest = scenes.world_points(bar)
    empty = pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.75))
    shift = scenes.world_points(bar) - rest
    assert empty.name == "Pin 1" and bar.arapfields.handles[0].kind == "PIN"
    tip = np.abs(rest - [1.0, 0.0, 0.25]).max(axis=1) < 0.1
    assert np.abs(shift[tip] - [0, 0, 0.5]).max() < 0.1
    assert np.abs(shift[rest[:, 0] < -0.8]).max() < 0.15  # without it everything would follow by 0.5


@pytest.mark.parametrize("locality", [0.0, None])
def test_without_anything_that_holds_the_shape_follows_as_a_whole(locality):
    """Without locality at once, with it where the pin is pulled far."""
    bar = scenes.bar()
    if locality is not None:
        bar.arapfields.deform.locality = locality
    rest = scenes.world_points(bar)
    empty = pin(bar, (1.0, 0.0, 0.25))
    bar.arapfields.keep_rest = False
    way = 0.5 if locality == 0 else 4.0
    empty.location.z += way
    step(refined=True)
    off = np.abs(scenes.world_points(bar) - rest - [0, 0, way]).max()
    assert off < (0.02 if locality == 0 else 0.5 * way)


def test_a_pin_alone_takes_its_surroundings():
    bar = scenes.bar()
    rest = scenes.world_points(bar)
    empty = pin(bar, (1.0, 0.0, 0.25))
    bar.arapfields.keep_rest = False
    empty.location.z += 0.1
    step(refined=True)
    moved = scenes.world_points(bar) - rest
    assert np.abs(moved[rest[:, 0] < -0.5]).max() < 0.01
    assert np.abs(moved[rest[:, 0] > 0.95][:, 2] - 0.1).max() < 0.05


def test_a_press_without_a_move_changes_no_shape():
    bar = scenes.bar()
    rest = scenes.world_points(bar)
    pin(bar, (1.0, 0.0, 0.25))
    assert np.array_equal(scenes.world_points(bar), rest)
    pin(bar, (-1.0, 0.0, 0.25), target=(-1.0, 0.0, 0.6))
    moved = scenes.world_points(bar)
    pin(bar, moved[np.abs(rest - TOP).sum(axis=1).argmin()])
    for _ in range(2):
        sessions.update(bpy.context, wait=WAIT, refined=True)
        assert np.array_equal(scenes.world_points(bar), moved)


@pytest.mark.parametrize("earlier", [0, 1])
def test_a_cancelled_drag_leaves_no_trace(earlier):
    bar = scenes.bar()
    rest = scenes.world_points(bar)
    if earlier:
        pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.1, 0.55))
    before = state(bar)
    where = scenes.world_points(bar)[np.abs(rest - TOP).sum(axis=1).argmin()]
    dragged = drag.of_new_pin(bpy.context, bar, where, 0.1)
    for shift in range(3):
        dragged.move(bpy.context, np.add(where, (0, 0, 0.1 * shift)))
        step()
    dragged.turn(bpy.context, (0, 1, 0), 0.5)
    step()
    assert state(bar)[4] != before[4]
    dragged.cancel(bpy.context)
    assert state(bar) == before
    sessions.update(bpy.context, wait=WAIT, refined=True)
    assert state(bar) == before
    if earlier:
        scenes.activate(bar.arapfields.handles[0].empty)
        before = state(bar)
        dragged = drag.of_entry(bpy.context, bar, bar.arapfields.handles[0])
        dragged.move(bpy.context, (0.5, 0.0, 0.9))
        step()
        dragged.cancel(bpy.context)
        assert state(bar) == before


def test_ending_live_mode_leaves_what_was_dragged():
    bar = scenes.bar()
    pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.6))
    shown = scenes.world_points(bar)
    sessions.end(bpy.context, bar)
    assert np.array_equal(scenes.world_points(bar), shown)


def test_the_last_pin_takes_the_motion_with_it():
    bar = scenes.bar()
    rest = scenes.world_points(bar)
    for x in (1.0, -1.0):
        pin(bar, (x, 0.0, 0.25), target=(x, 0.0, 0.5))
    for left in (1, 0):
        assert bpy.ops.arapfields.pin_delete() == {"FINISHED"}
        assert len(bar.arapfields.handles) == left and len(bpy.context.scene.objects) == left + 1
    assert not bar.modifiers and np.array_equal(scenes.world_points(bar), rest)
    assert bpy.context.view_layer.objects.active == bar


def lifted(hold_turn, keeps):
    """How far the middle of the bar went, and how its end turned (degrees): one end nailed, one lifted."""
    bar = scenes.bar()
    rest = scenes.world_points(bar)
    pin(bar, (-0.95, 0.0, 0.25), anchor=True)
    bar.arapfields.keep_rest = keeps
    pin(bar, (0.95, 0.0, 0.25), target=(0.6, 0.0, 0.9), kind="PIN" if hold_turn else "POINT")
    step(refined=True)
    shift = scenes.world_points(bar) - rest
    end = np.linalg.norm(rest - [0.95, 0.0, 0.25], axis=1) < 0.15
    turn = best_rotation(rest[end], rest[end] + shift[end])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    middle = np.abs(shift[np.abs(rest[:, 0] + 0.3) < 0.2]).mean()
    return middle, np.degrees(np.arccos((np.trace(turn) - 1) / 2))


def test_a_pin_of_place_lets_turn_and_the_rest_is_kept():
    (loose, _), (kept, held), (_, hanging) = lifted(True, False), lifted(True, True), lifted(False, True)
    assert kept < 0.5 * loose and held < 0.5 * hanging, (loose, kept, held, hanging)


def test_a_pin_holds_its_turn_as_the_surface_is_turned_then():
    bar = scenes.bar()
    pin(bar, (-0.95, 0.0, 0.25), anchor=True)
    pin(bar, (0.95, 0.0, 0.25), target=(0.6, 0.0, 0.9), kind="POINT")
    step(refined=True)
    before, entry = scenes.world_points(bar), bar.arapfields.handles[1]
    assert entry.kind == "POINT" and not entry.hold_turn
    entry.hold_turn = True
    step(refined=True)
    assert entry.kind == "PIN" and entry.empty.matrix_world.to_euler().y != 0
    assert np.abs(scenes.world_points(bar) - before).max() < 0.1


def test_a_second_copy_of_the_modifier_moves_nothing():
    bar = scenes.bar()
    pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.6))
    sessions.end(bpy.context, bar)
    shown = scenes.world_points(bar)
    scenes.activate(bar)
    bpy.ops.object.modifier_copy(modifier=bar.modifiers[0].name)
    bpy.context.view_layer.update()
    assert len(bar.modifiers) == 2 and np.array_equal(scenes.world_points(bar), shown)


def test_pins_of_a_deleted_source_can_go_along():
    bar = scenes.bar()
    pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.6))
    scenes.activate(bar)
    bpy.ops.object.delete()
    assert {source.name: len(items) for source, items in left_behind.of_deleted().items()} == {"Bar": 1}
    assert bpy.ops.arapfields.delete_left(source="Bar") == {"FINISHED"}
    assert not bpy.context.scene.objects


def test_what_cannot_be_pinned_is_named():
    bar = scenes.bar()
    bar.arapfields.result = "NEW"
    with pytest.raises(RuntimeError, match="Bar"):
        bpy.ops.arapfields.pin_add(location=(1, 0, 0.25))
    bar.arapfields.result = "MODIFIER"
    assert bpy.ops.arapfields.pin_add(location=(1, 0, 0.25), radius=0.2) == {"FINISHED"}


def test_a_solver_set_up_beforehand_gives_the_same_shape():
    shapes = []
    for is_prefetched, moved_on in ((False, False), (True, False), (True, True)):
        bar = scenes.bar()
        if is_prefetched:
            prefetch.prepare(bpy.context, bar)
        if moved_on:  # another mesh than that which was read
            bar.data.vertices[0].co.x += 0.01
            bar.data.update()
        pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.6))
        step(refined=True)
        assert prefetch.take(sessions.live[bar.session_uid].reader.setup) is None
        shapes.append(scenes.world_points(bar))
        bpy.data.objects.remove(bar.arapfields.handles[0].empty)
        bpy.data.objects.remove(bar)
    assert np.abs(shapes[1] - shapes[0]).max() < 1e-3
    assert 0 < np.abs(shapes[2] - shapes[0]).max() < 0.05


def test_a_drag_keys_the_pin_where_automatic_keys_are_on():
    bar = scenes.bar()
    assert pin(bar, (-1.0, 0.0, 0.25), 0.1, target=(-1.0, 0.0, 0.4)).animation_data is None
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    keyed = pin(bar, (1.0, 0.0, 0.25), 0.1, target=(1.0, 0.0, 0.6))
    assert keyed.animation_data.action is not None
    bpy.context.scene.frame_set(20)
    assert abs(keyed.location.z - 0.6) < 1e-6


@pytest.mark.parametrize("name", ["pin_hover", "pin_drag", "pin_turn", "pin_anchor"])
def test_what_needs_the_mouse_says_so_to_a_script(name):
    with pytest.raises(RuntimeError, match="A 3D view is needed"):
        getattr(bpy.ops.arapfields, name)("EXEC_DEFAULT")
