# SPDX-License-Identifier: GPL-3.0-or-later
"""The pin tool without a window: places, names, colours, and drags that are live and can be taken back."""

import pytest
from inside import in_blender

WAIT = 30  # seconds for a shape to follow
TOP = (0.0, 0.0, 0.25)  # on the bar


def pin(source, location, radius=0.15, target=None, **further):
    """Places a pin at a location as shown, and drags it to a target; its Empty."""
    import bpy
    import numpy as np
    from test_pins import follow

    from addon.pin_tool import drag

    dragged = drag.of_new_pin(bpy.context, source, np.array(location, float), radius, **further)
    if target is not None:
        dragged.move(bpy.context, target)
        follow()
    dragged.end(bpy.context)
    bpy.context.view_layer.update()
    return dragged.empty.get()


def follow(refined=False):
    import bpy
    from test_pins import WAIT

    from addon.live import sessions

    bpy.context.view_layer.update()
    sessions.update(bpy.context, wait=WAIT, refined=refined)


def state(source):
    """All that a cancelled drag must leave as it was."""
    import bpy
    import scenes

    settings, layer = source.arapfields, bpy.context.view_layer
    handles = [(e.empty.name, e.kind, e.anchor, tuple(e.rest), tuple(e.colour)) for e in settings.handles]
    empties = [
        (o.name, o.location[:], o.rotation_euler[:], o.rotation_quaternion[:], o.scale[:])
        for o in bpy.data.objects
    ]
    flags = settings.hold_far, settings.active_handle, settings.live_kind, layer.objects.active.name
    chosen = sorted(o.name for o in bpy.context.selected_objects)
    shape = scenes.world_points(source).tobytes()
    kinds = bpy.data.objects, bpy.data.meshes, bpy.data.node_groups, bpy.data.scenes, source.modifiers
    return handles, empties, flags, chosen, shape, [sorted(kind.keys()) for kind in kinds]


@in_blender
def test_the_first_drag_bends_and_what_is_far_holds():
    import numpy as np
    import scenes
    from test_pins import pin

    bar = scenes.bar()
    rest = scenes.world_points(bar)
    empty = pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.75))
    shift = scenes.world_points(bar) - rest
    assert empty.name == "Pin 1" and bar.arapfields.handles[0].kind == "PIN"
    tip = np.abs(rest - [1.0, 0.0, 0.25]).max(axis=1) < 0.1
    assert np.abs(shift[tip] - [0, 0, 0.5]).max() < 0.1
    assert np.abs(shift[rest[:, 0] < -0.8]).max() < 0.15  # without it everything would follow by 0.5


@in_blender
def test_without_anything_that_holds_the_shape_follows_as_a_whole():
    import numpy as np
    import scenes
    from test_pins import follow, pin

    bar = scenes.bar()
    rest = scenes.world_points(bar)
    empty = pin(bar, (1.0, 0.0, 0.25))
    bar.arapfields.hold_far = False
    empty.location.z += 0.5
    follow(refined=True)
    assert np.abs(scenes.world_points(bar) - rest - [0, 0, 0.5]).max() < 0.02


@in_blender
def test_a_press_without_a_move_changes_no_shape():
    import bpy
    import numpy as np
    import scenes
    from test_pins import TOP, WAIT, pin

    from addon.live import sessions

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
@in_blender
def test_a_cancelled_drag_leaves_no_trace(earlier):
    import bpy
    import numpy as np
    import scenes
    from test_pins import TOP, WAIT, follow, pin, state

    from addon.live import sessions
    from addon.pin_tool import drag

    bar = scenes.bar()
    rest = scenes.world_points(bar)
    if earlier:
        pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.1, 0.55))
    before = state(bar)
    where = scenes.world_points(bar)[np.abs(rest - TOP).sum(axis=1).argmin()]
    dragged = drag.of_new_pin(bpy.context, bar, where, 0.1)
    for step in range(3):
        dragged.move(bpy.context, np.add(where, (0, 0, 0.1 * step)))
        follow()
    dragged.turn(bpy.context, (0, 1, 0), 0.5)
    follow()
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
        follow()
        dragged.cancel(bpy.context)
        assert state(bar) == before


@in_blender
def test_ending_live_mode_leaves_what_was_dragged():
    import bpy
    import numpy as np
    import scenes
    from test_pins import pin

    from addon.live import sessions

    bar = scenes.bar()
    pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.6))
    shown = scenes.world_points(bar)
    sessions.end(bpy.context, bar)
    assert np.array_equal(scenes.world_points(bar), shown)


@in_blender
def test_the_last_pin_takes_the_motion_with_it():
    import bpy
    import numpy as np
    import scenes
    from test_pins import pin

    bar = scenes.bar()
    rest = scenes.world_points(bar)
    for x in (1.0, -1.0):
        pin(bar, (x, 0.0, 0.25), target=(x, 0.0, 0.5))
    for left in (1, 0):
        assert bpy.ops.arapfields.pin_delete() == {"FINISHED"}
        assert len(bar.arapfields.handles) == left and len(bpy.data.objects) == left + 1
    assert not bar.modifiers and np.array_equal(scenes.world_points(bar), rest)
    assert bpy.context.view_layer.objects.active == bar


@in_blender
def test_what_cannot_be_pinned_is_named():
    import bpy
    import pytest
    import scenes

    bar = scenes.bar()
    bar.arapfields.target = "NEW"
    with pytest.raises(RuntimeError, match="Bar"):
        bpy.ops.arapfields.pin_add(location=(1, 0, 0.25))
    bar.arapfields.target = "MODIFIER"
    assert bpy.ops.arapfields.pin_add(location=(1, 0, 0.25), radius=0.2) == {"FINISHED"}


@in_blender
def test_a_solver_set_up_beforehand_gives_the_same_shape():
    import bpy
    import numpy as np
    import scenes
    from test_pins import follow, pin

    from addon.live import sessions
    from addon.live.warm import warm

    shapes = []
    for is_warm, moved_on in ((False, False), (True, False), (True, True)):
        bar = scenes.bar()
        if is_warm:
            warm.prepare(bpy.context, bar)
        if moved_on:  # another mesh than that which was read
            bar.data.vertices[0].co.x += 0.01
            bar.data.update()
        pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.6))
        follow(refined=True)
        assert warm.take(sessions.live[bar.session_uid].surface, {}) is None
        shapes.append(scenes.world_points(bar))
        bpy.data.objects.remove(bar.arapfields.handles[0].empty)
        bpy.data.objects.remove(bar)
    assert np.abs(shapes[1] - shapes[0]).max() < 1e-3
    assert 0 < np.abs(shapes[2] - shapes[0]).max() < 0.05


@in_blender
def test_a_drag_keys_the_pin_where_automatic_keys_are_on():
    import bpy
    import scenes
    from test_pins import pin

    bar = scenes.bar()
    assert pin(bar, (-1.0, 0.0, 0.25), 0.1, target=(-1.0, 0.0, 0.4)).animation_data is None
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    keyed = pin(bar, (1.0, 0.0, 0.25), 0.1, target=(1.0, 0.0, 0.6))
    assert keyed.animation_data.action is not None
    bpy.context.scene.frame_set(20)
    assert abs(keyed.location.z - 0.6) < 1e-6
