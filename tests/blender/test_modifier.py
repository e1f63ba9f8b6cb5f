# SPDX-License-Identifier: GPL-3.0-or-later
"""The result as a modifier: compared with the field applied by hand, wherever it is in the stack."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER
from support.blender.stack_list import STACKS

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.stacks import build, by_hand, local_points

    from addon.blender import modifier_stack
    from addon.field_modifier import inputs

pytestmark = pytest.mark.in_blender

BY_HAND = 1e-5  # single precision of positions of size one, through Blender's modifiers


@pytest.mark.parametrize("case", STACKS)
def test_the_modifier_does_what_the_field_does_by_hand(case):
    bar, _, field = build(STACKS[case])
    own = [kind for kind in STACKS[case] if kind != "keys"]
    assert [modifier_stack.is_field(m) for m in bar.modifiers] == [kind == "FIELD" for kind in own]
    modifier = modifier_stack.find(bar)
    assert not modifier.node_group.is_modifier  # else Blender would offer it under Add Modifier
    modifier.show_viewport = False
    rest = local_points(bar)
    modifier.show_viewport = True
    moved = local_points(bar)
    assert np.abs(moved - rest).max() > 0.3
    assert np.abs(moved - by_hand(bar, field)).max() < BY_HAND
    inputs.put(modifier, "Factor", 0.5)
    assert np.abs(local_points(bar) - by_hand(bar, field, 0.5)).max() < BY_HAND
    inputs.put(modifier, "Factor", 1.0)
    group = bar.vertex_groups.new(name="Mask")
    group.add([v.index for v in bar.data.vertices if v.co.x > 0.5], 1.0, "REPLACE")
    inputs.put_attribute(modifier, "Mask", "Mask")
    masked = local_points(bar)
    assert np.abs(masked - rest).max() > 0.3
    if case in ("alone", "armature before", "shape keys", "mirror before"):
        left = (
            rest[:, 0] < 0.55
            if case != "armature before"
            else np.array([v.co.x <= 0.5 for v in bar.data.vertices])
        )
        assert left.any() and np.array_equal(masked[left], rest[left])
        assert np.array_equal(masked[~left], moved[~left])
    group.remove([v.index for v in bar.data.vertices])
    assert local_points(bar).tobytes() == rest.tobytes()
    assert len(bpy.data.scenes) == 1


def test_nothing_but_a_modifier_an_attribute_and_a_group_is_added():
    bar, _, moving = scenes.bar_with_handles()
    scenes.decorate(bar)
    before = scenes.everything(bar)
    moving.location.z += 0.4
    for _ in range(2):
        scenes.activate(bar)
        bpy.ops.arapfields.deform(**scenes.QUICK)
    contents = scenes.everything(bar)
    assert {key: value for key, value in contents.items() if key[0] != "ARAP Fields"} == before
    assert sorted(o.name for o in bpy.data.objects) == ["Bar", "Fixed", "Moving"]
    assert [g.name for g in bpy.data.node_groups] == ["ARAP Fields"] and len(bar.modifiers) == 1
    assert not bar.hide_render and not bar.hide_get()
    bpy.ops.arapfields.remove_field()
    assert scenes.everything(bar) == before and not bpy.data.node_groups and not bar.modifiers


def test_where_there_are_more_vertices_than_offsets_they_come_from_the_nearest_place():
    """As in a render at a higher level of subdivision than the viewport's."""
    bar, _, field = build(["SUBSURF", "FIELD"])
    bar.modifiers["Subsurf"].levels = 2
    modifier = bar.modifiers["ARAP Fields"]
    modifier.show_viewport = False
    rest = local_points(bar).astype(np.float64)
    modifier.show_viewport = True
    moved = local_points(bar)
    assert len(bpy.data.objects["Bar_offsets"].data.vertices) < len(rest)
    expected = field(rest)
    assert np.abs(expected - rest).max() > 0.3 and np.abs(moved - expected).max() < 0.02
