# SPDX-License-Identifier: GPL-3.0-or-later
"""With symmetry, handles and pins have ghosts on the other side."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.pins import pin

    from addon.live import sessions
    from addon.pin_tool import drawing
    from addon.viewport.handle_boxes import CIRCLE_ENDS, box_lines, ghosts, segments

pytestmark = pytest.mark.in_blender


def test_ghosts_are_where_the_other_side_is_held_and_goes():
    bar, fixed, moving = scenes.bar_with_handles()
    fixed.location, fixed.scale = (0, 0, 0), (0.1, 0.5, 0.5)
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.set_rest(all=True)
    assert ghosts(bar) == []
    bar.arapfields.deform.symmetry = "x"
    ((_, _, ends),) = ghosts(bar)  # none of the box on the plane
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    rest = np.array(moving.matrix_world)
    assert np.allclose(np.sort(ends, axis=0), np.sort(box_lines(mirror @ rest), axis=0), atol=1e-6)
    moving.location.z += 0.3
    bpy.context.view_layer.update()
    shapes = ghosts(bar)
    assert len(shapes) == 2 and len(segments(bar)) == 3
    now = np.array(shapes[1][2][:24])
    assert np.allclose(now.mean(axis=0), [-1, 0, 0.3], atol=1e-6)
    assert np.allclose(np.array(shapes[0][2]).mean(axis=0), [-1, 0, 0], atol=1e-6)
    bpy.ops.arapfields.live()
    step(refined=True)
    field = sessions.live[bar.session_uid].solver.field
    middle = np.array([[-1.0, 0.0, 0.0]])
    assert np.abs(field(middle) - now.mean(axis=0)).max() < 0.05  # what the ghost says is what happens
    bpy.ops.arapfields.live()


def test_pins_have_theirs_on_turned_and_scaled_objects_too():
    bar = scenes.bar()
    bar.location, bar.rotation_euler.z, bar.scale = (1, 2, 3), 0.7, (2, 2, 2)
    bpy.context.view_layer.update()
    world = np.array(bar.matrix_world)

    def at(*local):
        return (world @ [*local, 1.0])[:3]

    pin(bar, at(0.9, 0.0, 0.25), target=at(0.9, 0.0, 0.5))
    bar.arapfields.deform.symmetry = "x"
    handles = [(bar, entry) for entry in bar.arapfields.handles]
    ((_, _, spot),) = drawing.ghosts(handles)
    assert np.allclose(spot, at(-0.9, 0.0, 0.5), atol=1e-5)
    way, rest, now = (np.array(ends) for _, _, ends in ghosts(bar))
    assert np.allclose(way, [at(-0.9, 0.0, 0.25), at(-0.9, 0.0, 0.5)], atol=1e-5)
    assert len(rest) == len(now) == CIRCLE_ENDS
    assert np.allclose(rest.mean(axis=0), way[0], atol=1e-5)
    assert np.allclose(now.mean(axis=0), way[1], atol=1e-5)
    assert np.allclose(np.linalg.norm(now - way[1], axis=1), 0.15, atol=1e-5)
    bar.arapfields.deform.symmetry = "none"
    assert drawing.ghosts(handles) == [] and ghosts(bar) == []
