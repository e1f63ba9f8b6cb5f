# SPDX-License-Identifier: GPL-3.0-or-later
"""Carried objects of other files, overridden, hidden or lost while live, and what a mask says of them."""

import tempfile

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.riders import body, rider, shown
    from support.blender.scenes import delete

    from addon.blender.object_references import owner_of
    from addon.core.runtime import jobs
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

CLOSE = 1e-5  # single precision of positions of size one


def test_what_is_linked_is_named_and_the_rest_goes_on():
    bar, moving = body()
    linked = scenes.from_another_file(rider("MESH"))[0]
    scenes.activate(linked, bar)
    with pytest.raises(RuntimeError, match="Patch is linked from another file; make it local to carry it"):
        bpy.ops.arapfields.carry()
    good = rider("CURVE")
    scenes.activate(linked, good, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    assert [entry.item for entry in bar.arapfields.carried] == [good]
    entry = bar.arapfields.carried.add()  # one that was carried, and is linked now
    entry.name, entry.item = linked.name, linked
    before = shown(good), shown(linked)
    scenes.activate(bar)
    jobs.board.messages.clear()
    bpy.ops.arapfields.live()
    assert "Patch is linked from another file" in "\n".join(text for _, text in jobs.messages())
    moving.location.z += 0.4
    step(refined=True)
    assert np.abs(shown(good) - before[0] - [0, 0, 0.4]).max() < 0.1
    assert np.array_equal(shown(linked), before[1]) and not linked.modifiers
    bpy.ops.arapfields.live()
    bpy.ops.arapfields.release(all=True)


@pytest.mark.parametrize("kind", ["MESH", "EMPTY", "CURVES", "CURVE", "ARMATURE"])
def test_library_overrides_are_carried_or_named(kind):
    """What moves as a whole, a mesh and bones need none of the linked data; other points lie there."""
    bar, moving = body()
    linked = scenes.from_another_file(rider(kind))[0]
    item = linked.override_create(remap_local_usages=True)
    if item.name not in bpy.context.collection.objects:
        bpy.context.collection.objects.link(item)
    bpy.context.view_layer.update()
    before = shown(item)
    scenes.activate(item, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    scenes.activate(bar)
    jobs.board.messages.clear()
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    moving.location.z += 0.4
    step(refined=True)
    assert sessions.is_live(bar)
    messages = "\n".join(text for _, text in jobs.messages())
    if kind in ("CURVES", "CURVE"):
        assert f"{item.name} is linked from another file; make it local to carry it" in messages
        assert np.array_equal(shown(item), before)
    else:
        assert item.name not in messages and np.abs(shown(item) - before - [0, 0, 0.4]).max() < 0.1
    bpy.ops.arapfields.live()
    assert np.abs(shown(item) - before).max() < CLOSE


def test_baked_library_overrides_are_results_like_others():
    """In objects of their own, twice the same one, also after the file was opened again."""
    bar, moving = body()
    linked = scenes.from_another_file(rider("MESH"))[0]
    item = linked.override_create(remap_local_usages=True)
    scenes.activate(item, bar)
    bpy.ops.arapfields.carry(way="FOLLOW")
    moving.location.z += 0.4
    for _ in range(2):
        bar, item = bpy.data.objects["Bar"], next(o for o in bpy.data.objects if o.override_library)
        scenes.activate(bar)
        assert bpy.ops.arapfields.bake(format="KEYS", start=1, end=2) == {"FINISHED"}
        path = f"{tempfile.mkdtemp()}/scene.blend"
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        item = next(o for o in bpy.data.objects if o.override_library)
        baked = [entry.item for entry in item.arapfields.results]
        assert [owner_of(one) for one in baked] == [item] and item.arapfields.set_aside
        assert sum(other.name.startswith(baked[0].name) for other in bpy.data.objects) == 1


def test_one_that_is_hidden_or_deleted_while_live_is_named_and_nothing_of_the_rest_is_lost():
    bar, moving = body()
    items = [rider(kind) for kind in ("MESH", "CURVES", "EMPTY", "LATTICE")]
    bpy.context.view_layer.update()
    rest = [shown(item) for item in items]
    scenes.activate(*items, bar)
    bpy.ops.arapfields.carry()
    scenes.activate(bar)
    jobs.board.messages.clear()
    bpy.ops.arapfields.live()
    moving.location.z += 0.2
    step(refined=True)
    delete(items[1])
    bpy.data.objects.remove(items[3])
    moving.location.z += 0.2
    for _ in range(3):
        step(refined=True)
    assert sessions.is_live(bar)
    messages = "\n".join(text for _, text in jobs.messages())
    assert (
        "Hair, which Bar carries, was deleted" in messages
        and "Cage, which Bar carries, was deleted" in messages
    )
    items[0].hide_set(True)  # it is seen again where the field has it meanwhile
    moving.location.z += 0.1
    step(refined=True)
    items[0].hide_set(False)
    for item, before in ((items[0], rest[0]), (items[2], rest[2])):
        assert np.abs(shown(item) - before - [0, 0, 0.5]).max() < 0.1
    bpy.ops.arapfields.live()
    for item, before in ((items[0], rest[0]), (items[2], rest[2])):
        assert np.abs(shown(item) - before).max() < CLOSE
    for index in reversed(range(4)):
        bar.arapfields.active_carried = index
        bpy.ops.arapfields.release()
    assert not bar.arapfields.carried and not items[0].modifiers


def test_the_influence_mask_counts_where_a_carried_object_has_weights_of_that_name():
    bar, moving = body()
    bar.vertex_groups.new(name="Face").add(list(range(len(bar.data.vertices))), 1.0, "REPLACE")
    items = [rider(kind) for kind in ("MESH", "CURVES", "LATTICE", "CURVE", "EMPTY")]
    patch, hair, cage = items[:3]
    patch.vertex_groups.new(name="Face").add([0, 1], 1.0, "REPLACE")
    cage.vertex_groups.new(name="Face").add(range(4), 1.0, "REPLACE")
    hair.data.attributes.new("Face", "FLOAT", "POINT").data.foreach_set("value", [1, 1, 0, 0])
    bpy.context.view_layer.update()
    rest = [shown(item) for item in items]
    moves = [np.array([1, 1, 0, 0]), np.array([1, 1, 0, 0]), np.r_[np.ones(4), np.zeros(4)], 1, 1]
    scenes.activate(*items, bar)
    bpy.ops.arapfields.carry()
    moving.location.z += 0.4
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    step(refined=True)
    for name in ("Face", "", "Face"):
        bar.arapfields.stiffness.mask = name
        for item, before, share in zip(items, rest, moves, strict=True):
            share = np.broadcast_to(share if name else 1, len(before))
            shifts = shown(item) - before
            assert np.abs(shifts[share == 0]).max(initial=0) < CLOSE, (item.name, name)
            assert np.abs(shifts[share == 1] - [0, 0, 0.4]).max() < 0.15, (item.name, name)
    bpy.ops.arapfields.live()
