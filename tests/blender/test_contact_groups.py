# SPDX-License-Identifier: GPL-3.0-or-later
"""Collections in the list of obstacles."""

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    from addon.solver import contact

pytestmark = pytest.mark.in_blender


def test_a_collection_that_puts_nothing_in_the_way_is_said():
    bar, *_ = scenes.bar_with_handles()
    block = scenes.bar("Block")
    block.location.z = -1
    group, real, placed = (
        bar.arapfields.contact,
        *(bpy.data.collections.new(name) for name in ("Real", "Set")),
    )
    for one in (real, placed):
        bpy.context.scene.collection.children.link(one)
    real.objects.link(block)
    bpy.context.collection.objects.unlink(block)
    instance = bpy.data.objects.new("Placed", None)
    placed.objects.link(instance)
    instance.instance_type, instance.instance_collection = "COLLECTION", real
    group.use = True
    entry = group.obstacle_list.add()
    entry.group = real
    assert contact.entry_refusal(bar, entry) is None
    bpy.context.view_layer.layer_collection.children["Real"].exclude = True
    bpy.context.view_layer.update()
    assert str(contact.refusal(bar)) == "Real has no visible mesh that is in the way"
    entry.group = placed
    assert str(contact.refusal(bar)) == "Placed is an instance; make it real to have it in the way"
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="Placed is an instance"):
        bpy.ops.arapfields.deform()
