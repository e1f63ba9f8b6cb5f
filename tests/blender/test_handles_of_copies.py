# SPDX-License-Identifier: GPL-3.0-or-later
"""A copy of an object lists the same handles, whose Empties stay those of the first."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.pins import pin

    from addon.blender.object_references import owner_of
    from addon.handles import empties
    from addon.live import sessions
    from addon.pin_tool.pins import handles_in_view

pytestmark = pytest.mark.in_blender

AWAY = (0.0, 3.0, 0.0)  # of the copy


def posed_and_copied(linked):
    """(bar, its copy, the Empty of the one pin by which the bar was posed)."""
    bar = scenes.bar()
    empty = pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.6))
    sessions.end(bpy.context, bar, keep=True)
    scenes.activate(bar)
    bpy.ops.object.duplicate(linked=linked)
    copied = bpy.context.object
    copied.location = AWAY
    bpy.context.view_layer.update()
    return bar, copied, empty


@pytest.mark.parametrize("linked", [False, True])
def test_a_copy_is_not_pulled_to_the_handles_of_the_first(linked):
    _, copied, empty = posed_and_copied(linked)
    shown = scenes.world_points(copied)
    with pytest.raises(RuntimeError, match="Drag a pin or add a handle first"):
        bpy.ops.arapfields.deform(**scenes.QUICK)
    assert [(source.name, entry.empty) for source, entry in handles_in_view(bpy.context)] == [("Bar", empty)]
    own = pin(copied, (-1.0, 3.0, 0.25), target=(-1.0, 3.0, 0.6))
    assert [entry.empty for entry in empties.used(copied)] == [own]
    moved = scenes.world_points(copied)
    assert 0.3 < np.abs(moved - shown).max() < 0.6  # three times as far, if it followed the other's pin
    empty.location.z += 0.3
    step(refined=True)
    assert np.array_equal(scenes.world_points(copied), moved)


@pytest.mark.parametrize("delete", [False, True])
def test_a_row_of_a_copy_goes_without_the_handle_of_the_first(delete):
    bar, copied, empty = posed_and_copied(linked=False)
    assert bpy.ops.arapfields.remove_handle(delete=delete) == {"FINISHED"}
    assert not copied.arapfields.handles
    assert owner_of(empty) == bar and [entry.empty for entry in empties.used(bar)] == [empty]


def test_a_copy_that_is_left_has_the_handles():
    bar, copied, empty = posed_and_copied(linked=False)
    bpy.data.objects.remove(bar)
    assert [entry.empty for entry in empties.used(copied)] == [empty]


def test_handles_of_a_hidden_object_are_not_in_view():
    bar, copied, empty = posed_and_copied(linked=False)
    own = pin(copied, (-1.0, 3.0, 0.25), target=(-1.0, 3.0, 0.6))
    bar.hide_set(True)
    assert [(source, entry.empty) for source, entry in handles_in_view(bpy.context)] == [(copied, own)]
    result = bpy.data.objects.new("Result", bar.data.copy())
    bpy.context.collection.objects.link(result)
    bar.arapfields.results.add().item = result
    assert empty in [entry.empty for _, entry in handles_in_view(bpy.context)]
