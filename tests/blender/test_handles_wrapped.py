# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles that were made before a wrap go with the surface that they hold."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.wraps import SMALL

    from addon.blender.object_references import settings_of
    from addon.core.runtime import jobs

pytestmark = pytest.mark.in_blender

SIDES = 1e-3  # of the bar's length: matrices in single precision
SAME = 1e-5  # the same, of those that were stored


def handled_bar(**place):
    """(bar, fixed, moving, target): its handles lie elsewhere than the target."""
    bar, fixed, moving = scenes.bar_with_handles()
    target = scenes.bar("Scan")
    target.location, target.rotation_euler, target.scale = (3, 1, 0.5), (0, 0, 0.5), (1.5, 1.8, 1.4)
    bar.arapfields.wrap.onto = target
    for name, value in place.items():
        setattr(bar, name, value)
    scenes.activate(bar)
    bpy.context.view_layer.update()
    return bar, fixed, moving, target


def held(bar):
    return [entry.inside for entry in settings_of(bar).handles]


@pytest.mark.parametrize("rigid", [True, False])
def test_boxes_go_with_what_they_hold(rigid):
    bar, fixed, moving, _ = handled_bar(**({} if rigid else {"scale": (1.0, 1.3, 0.8)}))
    rest, counts = scenes.world_points(bar), held(bar)
    for count in range(2):  # once more as well
        assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
        shown = scenes.world_points(bar)
        for empty, side in ((fixed, -1), (moving, 1)):
            ends = np.abs(rest[:, 0] - side) < 0.25
            local = (shown - np.array(empty.matrix_world.translation)) @ np.linalg.inv(
                np.array(empty.matrix_world)[:3, :3]
            ).T
            inside = (np.abs(local) <= 1 + SIDES).all(axis=1)
            assert inside[ends].all() and inside.sum() < 1.5 * ends.sum(), (count, side)
        assert min(held(bar)) > 0.5 * min(counts)
    before = scenes.world_points(bar)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert np.abs(scenes.world_points(bar) - before).max() < 0.01  # all are at rest
    bpy.ops.arapfields.remove_field()
    bpy.ops.arapfields.remove_field()
    assert np.array_equal(scenes.world_points(bar), rest)
    for empty, side in ((fixed, -1), (moving, 1)):
        assert np.abs(np.array(empty.matrix_world.translation) - [side, 0, 0]).max() < SAME
        assert np.abs(np.array(empty.scale) - [0.25, 0.5, 0.5]).max() < SAME
    assert held(bar) == counts


def test_a_handle_that_was_moved_keeps_its_motion():
    bar, _, moving, _ = handled_bar()
    moving.location.z += 0.3
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    bpy.ops.arapfields.reset_handle(all=True)
    bpy.context.view_layer.update()
    assert min(held(bar)) > 0
    before = scenes.world_points(bar)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert np.abs(scenes.world_points(bar) - before).max() < 0.01


def test_one_that_is_animated_stays_and_is_named():
    bar, _, moving, _ = handled_bar()
    moving.keyframe_insert("location", frame=1)
    place = moving.matrix_world.copy()
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    assert moving.matrix_world == place and held(bar)[1] == 0 < held(bar)[0]
    assert any("Moving" in text for kind, text in jobs.messages() if kind == "WARNING"), jobs.messages()


def test_pins_go_along_and_keep_their_size():
    bar, *_ = handled_bar()
    bpy.ops.arapfields.pin_add(location=(1.0, 0.0, 0.25))
    pin = settings_of(bar).handles[-1].empty
    size, rest = pin.matrix_world.to_scale(), scenes.world_points(bar)
    nearest = np.abs(rest - [1.0, 0.0, 0.25]).sum(axis=1).argmin()
    scenes.activate(bar)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    away = np.array(pin.matrix_world.translation) - scenes.world_points(bar)[nearest]
    assert np.linalg.norm(away) < 0.1 and np.allclose(pin.matrix_world.to_scale(), size, rtol=1e-4)


def test_a_new_object_leaves_them_where_they_are():
    bar, fixed, *_ = handled_bar()
    place = fixed.matrix_world.copy()
    assert bpy.ops.arapfields.wrap(**SMALL, result="NEW") == {"FINISHED"}
    assert fixed.matrix_world == place and min(held(bar)) > 0
