# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects whose scale is animated: what squashes and stretches, grows from nothing, or vanishes."""

import tempfile

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.baking import animated, at
    from support.blender.live import step

    from addon.core.geometry.spaces import unflattened
    from addon.live import sessions
    from addon.solver import setup

pytestmark = pytest.mark.in_blender

SINGLE = 1e-6  # Blender keeps coordinates in single precision
HELD = 0.02  # how near a soft handle is met


def scaled(item, scales):
    """Keys the scale of an object: {frame: scale}."""
    for frame, scale in scales.items():
        item.scale = scale
        item.keyframe_insert("scale", frame=frame)


def bar_of_five_frames():
    """A bar whose right end rises from frame 1 to frame 5, and whose handles go along with it."""
    setup.SAMPLES = 500
    bar = animated()
    for entry in bar.arapfields.handles:
        entry.empty.parent = bar
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 5
    return bar


def played(bar):
    """{frame: local points} of a live bar; it is off again then."""
    bpy.context.scene.frame_set(1)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    shapes = {}
    for frame in range(1, 6):
        bpy.context.scene.frame_set(frame)
        step(refined=True)
        assert sessions.is_live(bar)
        shapes[frame] = at(bar, frame)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    return shapes


def baked(bar):
    bpy.context.scene.frame_set(1)
    scenes.activate(bar)
    path = tempfile.mktemp(suffix=".pc2")
    assert bpy.ops.arapfields.bake(start=1, end=5, format="PC2", filepath=path) == {"FINISHED"}
    return {frame: at(bar, frame) for frame in range(1, 6)}


def test_what_squashes_and_stretches_is_posed_as_at_first_and_scaled_as_a_whole():
    bar = bar_of_five_frames()
    plain = played(bar)
    scaled(bar, {1: (1, 1, 1), 3: (1.4, 1.4, 0.5), 5: (1, 1, 1)})
    squashed = played(bar)
    for frame, shape in baked(bar).items():
        assert np.abs(squashed[frame] - plain[frame]).max() < HELD
        assert np.abs(squashed[frame] - shape).max() < SINGLE


def test_a_handle_that_stays_in_the_world_is_met_where_it_is():
    bar = bar_of_five_frames()
    moving = bpy.data.objects["Moving"]
    moving.parent = None
    scaled(bar, {1: (1, 1, 1), 5: (1.2, 1.2, 0.7)})
    bpy.context.scene.frame_set(1)
    held = np.flatnonzero(scenes.world_points(bar)[:, 0] > 0.8)
    played(bar)
    shape = baked(bar)[5]
    world = shape[held].mean(axis=0) @ np.array(bar.matrix_world)[:3, :3].T
    assert np.abs(world - np.array(moving.matrix_world.translation)).max() < HELD


@pytest.mark.parametrize("of", ["itself", "parent", "one axis", "hat", "whole hat"])
def test_what_grows_from_nothing_and_vanishes_is_played_and_baked(of):
    bar = bar_of_five_frames()
    plain = played(bar)
    nothing, full = (1, 1, 0) if of == "one axis" else (0, 0, 0), (1, 1, 1)
    growing = bar
    if of == "parent":
        growing = scenes.cube_empty((0, 0, 0), full, "Parent")
        bar.parent = growing
    elif "hat" in of:
        growing = scenes.bar("Hat", 0.2)
        growing.location = (1, 0, 0.5)
        scenes.activate(growing, bar)
        bpy.ops.arapfields.carry()
        bar.arapfields.carried[0].way = "RIGID" if of == "whole hat" else "FOLLOW"
    scaled(growing, {1: nothing, 2: full, 4: full, 5: nothing})
    shapes, shown = played(bar), baked(bar)
    for frame in range(1, 6):
        assert np.abs(shapes[frame] - shown[frame]).max() < SINGLE
    for frame in (2, 3, 4):
        assert np.abs(shapes[frame] - plain[frame]).max() < HELD


@pytest.mark.parametrize("scale", [(0, 0, 0), (2, 0, 3), (0, 0, -2), (1, 2, 3)])
def test_a_matrix_that_flattens_gets_a_volume(scale):
    turn = Matrix.Rotation(0.7, 4, (1, 2, 3))
    matrix = np.array(Matrix.Translation((1, 2, 3)) @ turn @ Matrix.LocRotScale(None, None, scale))
    full = unflattened(matrix)
    scales = np.linalg.norm(full[:3, :3], axis=0)
    assert np.allclose(full[:3, 3], matrix[:3, 3]) and np.linalg.det(full[:3, :3]) > 0.5
    for axis, given in enumerate(scale):
        assert np.isclose(scales[axis], abs(given) or max(map(abs, scale)) or 1.0)
        assert not given or np.allclose(full[:3, axis], matrix[:3, axis])
