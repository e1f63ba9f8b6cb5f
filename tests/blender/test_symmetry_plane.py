# SPDX-License-Identifier: GPL-3.0-or-later
"""Symmetry with the origin beside the mesh, as after an import: across its own middle, which is said."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.pins import pin

    from addon.core.runtime import jobs
    from addon.handles import symmetry
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

UP = np.array([0.0, 0.0, 0.4])
BESIDE = 3.0  # how far the bar's middle is from its origin, in its coordinates


def bar_beside_its_origin(scale=1.0):
    bar = scenes.bar()
    for vertex in bar.data.vertices:
        vertex.co.x += BESIDE
    bar.data.update()
    bar.location.x, bar.scale = 0.5, (scale, 1.0, 1.0)
    bpy.context.view_layer.update()
    return bar


def lifts(bar, rest):
    """How far the two ends have risen."""
    rise = (scenes.world_points(bar) - rest)[:, 2]
    ends = rest[:, 0] < rest[:, 0].min() + 0.1, rest[:, 0] > rest[:, 0].max() - 0.1
    return [float(rise[end].mean()) for end in ends]


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_drag_moves_both_sides(scale):
    bar = bar_beside_its_origin(scale)
    rest = scenes.world_points(bar)
    bar.arapfields.deform.symmetry = "x"
    right = np.array([rest[:, 0].max(), 0.0, 0.25])
    pin(bar, right, target=right + UP)
    step(refined=True)
    left, lifted = lifts(bar, rest)
    assert lifted > 0.2 and abs(left - lifted) < 0.02
    middle = (scenes.world_points(bar)[:, 0].min() + scenes.world_points(bar)[:, 0].max()) / 2
    assert abs(middle - (0.5 + scale * BESIDE)) < 0.02
    mirrored = symmetry.mirror_of(bar) @ [*right, 1.0]
    assert np.abs(mirrored[:3] - [rest[:, 0].min(), 0.0, 0.25]).max() < 0.01


def test_deform_does_the_same_and_says_so():
    bar = bar_beside_its_origin()
    rest = scenes.world_points(bar)
    right = np.array([rest[:, 0].max(), 0.0, 0.25])
    pin(bar, right, target=right + UP)
    sessions.end(bpy.context, bar)
    bar.arapfields.deform.symmetry = "x"
    jobs.board.messages.clear()
    bpy.ops.arapfields.deform(samples=1000)
    left, lifted = lifts(bar, rest)
    assert lifted > 0.2 and abs(left - lifted) < 0.02
    assert any("across the middle of Bar" in text for _, text in jobs.messages())


def test_a_switch_of_symmetry_while_live_takes_the_plane_in():
    bar = bar_beside_its_origin()
    rest = scenes.world_points(bar)
    right = np.array([rest[:, 0].max(), 0.0, 0.25])
    pin(bar, right, target=right + UP)
    left, lifted = lifts(bar, rest)
    assert abs(left - lifted) > 0.2
    bar.arapfields.deform.symmetry = "x"
    step(refined=True)
    step(refined=True)
    left, lifted = lifts(bar, rest)
    assert abs(left - lifted) < 0.02


def test_the_origins_plane_counts_where_it_is_one_or_none_is():
    bar = scenes.bar()
    assert symmetry.offset_of(bar, "x") == symmetry.offset_of(bar, "z") == 0.0
    assert symmetry.beside(bar, "x") is None
    for vertex in bar.data.vertices:  # a wedge that leans: across no plane x = c
        vertex.co.x += BESIDE + 2.0 * vertex.co.z
    bar.data.update()
    assert symmetry.offset_of(bar, "x") == 0.0
    assert abs(symmetry.offset_of(bar_beside_its_origin(), "x") - BESIDE) < 0.01
