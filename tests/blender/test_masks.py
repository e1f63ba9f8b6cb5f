# SPDX-License-Identifier: GPL-3.0-or-later
"""The influence mask: a vertex group of the source that every result of the field heeds."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import RUN, cache_file
    from support.blender.live import step
    from support.blender.stacks import local_points

    from addon.blender import modifier_stack
    from addon.field_modifier import inputs

pytestmark = pytest.mark.in_blender


def masked_bar():
    """(bar, moving, rest, masked out): the mask is 1 right of 0, else 0; the right end is pulled up."""
    bar, _, moving = scenes.bar_with_handles()
    rest = local_points(bar)
    bar.vertex_groups.new(name="Face").add(np.flatnonzero(rest[:, 0] > 0.01).tolist(), 1.0, "REPLACE")
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    scenes.activate(bar)
    return bar, moving, rest, rest[:, 0] < 0.01


def test_where_it_is_zero_points_stay_bit_for_bit_whatever_is_solved():
    bar, _, rest, out = masked_bar()
    settings = bar.arapfields.stiffness
    settings.mask = "Face"  # before there is a modifier
    bpy.ops.arapfields.deform(**RUN)
    assert np.array_equal(local_points(bar)[out], rest[out]) and np.abs(local_points(bar) - rest).max() > 0.2
    settings.mask = ""
    assert np.abs(local_points(bar)[out] - rest[out]).max() > 0.01
    settings.mask = "Face"
    assert np.array_equal(local_points(bar)[out], rest[out])
    bar.modifiers.remove(modifier_stack.find(bar))
    bpy.ops.arapfields.live()
    step()
    assert np.array_equal(local_points(bar)[out], rest[out]) and np.abs(local_points(bar) - rest).max() > 0.2
    bpy.ops.arapfields.live()
    bpy.ops.arapfields.bake(start=1, end=2, filepath=cache_file())
    assert modifier_stack.find_cache(bar).vertex_group == "Face"
    assert np.array_equal(local_points(bar)[out], rest[out]) and np.abs(local_points(bar) - rest).max() > 0.2
    settings.mask = ""
    assert modifier_stack.find_cache(bar).vertex_group == ""
    bpy.ops.arapfields.deform(**RUN)
    inputs.put_attribute(modifier_stack.find(bar), "Mask", "Face")  # the user's own, at the modifier
    bpy.ops.arapfields.deform(**RUN)
    assert inputs.get_attribute(modifier_stack.find(bar), "Mask") == "Face"


def test_a_mask_that_is_gone_is_named():
    bar, _, rest, _ = masked_bar()
    bar.arapfields.stiffness.mask = "Face"
    bar.vertex_groups.remove(bar.vertex_groups["Face"])
    for call in (lambda: bpy.ops.arapfields.deform(**RUN), bpy.ops.arapfields.live):
        with pytest.raises(RuntimeError, match="Bar has no vertex group Face"):
            call()
    assert np.array_equal(local_points(bar), rest) and len(bar.arapfields.handles) == 2
