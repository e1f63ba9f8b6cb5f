# SPDX-License-Identifier: GPL-3.0-or-later
"""Wrapping an object onto another inside Blender: what moves, what stays, what is refused."""

from inside import in_blender


@in_blender
def test_the_object_comes_to_lie_on_the_target_and_the_factor_goes_back():
    import bpy
    import numpy as np
    import scenes
    from wraps import SMALL, bar_and_target

    from addon.blender import modifier_stack
    from addon.field_modifier import inputs

    item, target = bar_and_target()
    rest, there = scenes.world_points(item), scenes.world_points(target)
    for index in (0, len(rest) // 2, len(rest) - 1):
        assert bpy.ops.arapfields.add_landmark(rest=rest[index], on_target=there[index]) == {"FINISHED"}
    kept = scenes.everything(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    after = scenes.world_points(item)
    assert np.linalg.norm(after - there, axis=1).mean() < 0.15
    now = scenes.everything(item)
    assert all(now[name] == value for name, value in kept.items())
    modifier = modifier_stack.find(item)
    inputs.put(modifier, "Factor", 0.0)
    bpy.context.view_layer.update()
    assert np.array_equal(scenes.world_points(item), rest)


@in_blender
def test_landmarks_are_pairs_of_empties_that_move_with_both():
    import bpy
    import numpy as np
    import scenes
    from wraps import bar_and_target

    from addon.core.geometry.spaces import space_of
    from addon.wrap import landmarks

    item, target = bar_and_target()
    rest, there = scenes.world_points(item), scenes.world_points(target)
    bpy.ops.arapfields.add_landmark(rest=rest[0] + 0.01, on_target=there[0] - 0.01)
    (entry,) = landmarks.used(item)
    assert entry.rest.parent == item and entry.on_target.parent == target
    assert np.abs(np.array(entry.rest.matrix_world.translation) - rest[0]).max() < 0.02
    target.location.z += 1.0
    bpy.context.view_layer.update()
    ((_, moved),) = landmarks.read(item, space_of(item.matrix_world, item.name))
    assert abs(moved[2] - there[0][2] - 1.0) < 0.02
    assert bpy.ops.arapfields.remove_landmark(index=0) == {"FINISHED"}
    assert not landmarks.used(item) and not [o for o in bpy.data.objects if o.type == "EMPTY"]


@in_blender
def test_what_cannot_be_wrapped_onto_is_named_and_nothing_is_lost():
    import bpy
    import pytest
    import scenes
    from wraps import SMALL, bar_and_target

    item, target = bar_and_target()
    kept = scenes.everything(item)
    empty = bpy.data.objects.new("Nothing", bpy.data.meshes.new("Nothing"))
    bpy.context.collection.objects.link(empty)
    item.arapfields.wrap.onto = empty
    with pytest.raises(RuntimeError, match="Nothing: the mesh is empty"):
        bpy.ops.arapfields.wrap(**SMALL)
    with pytest.raises(RuntimeError, match="no object Gone"):
        bpy.ops.arapfields.wrap(onto="Gone", **SMALL)
    with pytest.raises(RuntimeError, match="Bar is no other mesh object"):
        bpy.ops.arapfields.wrap(onto="Bar", **SMALL)
    item.arapfields.wrap.onto = target
    bpy.ops.arapfields.add_landmark(rest=(0, 0, 0), on_target=(3, 1, 0))
    entry = item.arapfields.wrap.landmarks[0]
    entry.on_target.location.z += 50
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=r"landmarks\[0\]"):
        bpy.ops.arapfields.wrap(**SMALL)
    bpy.data.objects.remove(target)
    with pytest.raises(RuntimeError, match="choose the object to wrap Bar onto"):
        bpy.ops.arapfields.wrap(**SMALL)
    assert scenes.everything(item) == kept and not item.modifiers


@in_blender
def test_a_rigged_template_goes_onto_a_soup_with_its_uvs_groups_and_keys():
    import bpy
    import numpy as np
    import scenes
    from wraps import SMALL, rigged_bar, soup_of

    import arapfields as af

    item, _ = rigged_bar()
    soup = soup_of(item)
    item.arapfields.wrap.onto = soup
    kept = scenes.everything(item)
    keys = [tuple(p.co) for p in item.data.shape_keys.key_blocks["Fat"].data]
    rest = scenes.world_points(item)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    now = scenes.everything(item)
    assert all(now[name] == value for name, value in kept.items())
    assert [tuple(p.co) for p in item.data.shape_keys.key_blocks["Fat"].data] == keys
    wrapped = scenes.world_points(item)
    target = scenes.world_points(soup)
    corners = np.array([t.vertices for t in soup.data.polygons])
    diagonal = np.linalg.norm(np.ptp(target, axis=0))
    assert np.abs(af.MeshSdf(target, corners)(wrapped)).mean() < 0.02 * diagonal
    assert np.linalg.norm(wrapped - rest, axis=1).min() > 1.0
