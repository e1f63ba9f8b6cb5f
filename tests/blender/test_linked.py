# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects linked from another file: undo leaves them as they are, so they refer to nothing of this one."""

import tempfile

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.stacks import QUICK, STYLE, structure, styled, with_handles

    from addon.blender.object_references import owner_of, source_of
    from addon.field_modifier import cache_modifier, layers
    from addon.handles import empties
    from addon.pin_tool import pins
    from addon.wrap import landmarks
    from tests.blender.walk import world

pytestmark = pytest.mark.in_blender


def push(message):
    bpy.ops.ed.undo_push(message=message)


def undo_begins():
    bpy.context.preferences.edit.use_global_undo = True


def undo(times=1):
    for _ in range(times):
        bpy.ops.ed.undo()
        assert not world.dangling()
        bpy.context.view_layer.update()


def with_linked_empty():
    """(bar, linked Empty that is its handle), in steps of undo: linked, bar, handle."""
    undo_begins()
    empty = scenes.from_another_file(scenes.cube_empty((1, 0, 0), (0.3, 0.6, 0.6), "Far"))[0]
    push("linked")
    bar = scenes.bar()
    push("bar")
    bpy.context.view_layer.update()
    scenes.activate(empty, bar)
    assert bpy.ops.arapfields.add_handle() == {"FINISHED"}
    push("handle")
    return bar, empty


def test_a_linked_empty_is_a_handle_and_does_not_point_to_its_mesh():
    bar, empty = with_linked_empty()
    assert empty.arapfields.handle_of is None and empty.parent is None
    assert [entry.empty for entry in empties.used(bar)] == [empty] and owner_of(empty) == bar
    scenes.activate(empty)
    assert source_of(bpy.context) == bar
    bar.arapfields.handles[0].in_world = False  # nothing that another file has can hang on it
    assert empty.parent is None and bar.arapfields.handles[0].in_world
    push("in world")
    undo(3)
    empty = bpy.data.objects["Far"]
    assert owner_of(empty) is None and source_of(bpy.context) is None


def test_a_linked_empty_that_is_a_handle_already_is_refused():
    scenes.bar_with_handles("Other")
    names = ("Other", *(entry.empty.name for entry in bpy.data.objects["Other"].arapfields.handles))
    linked = scenes.from_another_file(*(bpy.data.objects[name] for name in names))
    bar = scenes.bar()
    bpy.context.view_layer.update()
    scenes.activate(linked[1], bar)
    with pytest.raises(RuntimeError, match="is linked from another file; make it local first"):
        bpy.ops.arapfields.add_handle()
    assert not bar.arapfields.handles and owner_of(linked[1]) == linked[0]


def test_a_style_that_another_file_has_stays_where_a_new_one_is_made():
    bar, _, _ = styled()
    with_handles(bar).location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**QUICK)
    ends = [entry.empty for entry in bar.arapfields.handles]
    bar = scenes.from_another_file(bar, *ends)[0]
    scenes.activate(bar)
    before, shape = structure(bar)[:4], scenes.world_points(bar)
    undo_begins()
    push("linked")
    for run in (bpy.ops.arapfields.stylize, bpy.ops.arapfields.deform):
        scenes.activate(bar)
        assert run(result="NEW", **(STYLE if run == bpy.ops.arapfields.stylize else QUICK)) == {"FINISHED"}
        push("new")
    assert structure(bar)[:4] == before and np.array_equal(scenes.world_points(bar), shape)
    undo(2)
    assert structure(bar)[:4] == before


def test_a_result_of_a_linked_object_is_an_object_of_its_own():
    bar = scenes.from_another_file(scenes.bar())[0]
    scenes.activate(bar)
    assert bpy.ops.arapfields.stylize(result="NEW", **STYLE) == {"FINISHED"}
    made = bpy.context.object
    assert made != bar and source_of(bpy.context) == made and pins.refusal(made) is None


def test_live_mode_of_a_linked_object_ends_under_undo():
    bar = scenes.from_another_file(scenes.bar())[0]
    bar.arapfields.result = "NEW"
    scenes.activate(bar)
    undo_begins()
    push("linked")
    assert bpy.ops.arapfields.live(kind="STYLIZE") == {"FINISHED"}
    push("live")
    world.settle()
    undo()
    world.settle()
    bar = bpy.data.objects["Bar"]
    assert not world.dangling() and not bar.arapfields.live_kind and "Bar_live" not in bpy.data.objects
    assert bar.visible_get() and not bar.hide_render


def test_landmarks_on_a_target_in_a_linked_collection():
    target = scenes.bar("Scan")
    home = bpy.data.collections.new("Scans")
    home.objects.link(target)
    path = f"{tempfile.mkdtemp()}/other.blend"
    bpy.data.libraries.write(path, {home})
    bpy.data.objects.remove(target)
    bpy.data.collections.remove(home)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.collections = ["Scans"]
    bpy.context.scene.collection.children.link(into.collections[0])
    bpy.context.view_layer.update()
    undo_begins()
    push("linked")
    bar = scenes.bar()
    bar.arapfields.wrap.onto = bpy.data.objects["Scan"]
    push("bar")
    scenes.activate(bar)
    assert bpy.ops.arapfields.add_landmark(rest=(1, 0, 0), on_target=(1, 0, 0)) == {"FINISHED"}
    assert len(landmarks.used(bar)) == 1 and not world.dangling()
    push("landmark")
    undo(2)


def test_a_layer_of_a_linked_object_stays_where_something_is_transferred():
    bar, _, _ = styled()
    with_handles(bar)
    assert layers.LAYER_GROUP in bar.modifiers[0].node_group
    ends = [entry.empty for entry in bar.arapfields.handles]
    bar = scenes.from_another_file(bar, *ends)[0]
    before = structure(bar)[:4]
    scenes.bar("Scan")
    scenes.activate(bar)
    assert bpy.ops.arapfields.transfer(onto="Scan", transfer={"GROUPS"}) == {"FINISHED"}
    assert structure(bar)[:4] == before


@pytest.mark.parametrize("kind", ["PC2", "KEYS"])
def test_a_bake_leaves_a_linked_object_as_it_is(tmp_path, kind):
    """A modifier there would be gone once the file is opened again; a new object plays the frames."""
    scenes.bar_with_handles()
    ends = [entry.empty for entry in bpy.data.objects["Bar"].arapfields.handles]
    bar = scenes.from_another_file(bpy.data.objects["Bar"], *ends)[0]
    scenes.activate(bar)
    given = {"folder": str(tmp_path), "format": kind, "range": "CUSTOM", "start": 1, "end": 2}
    assert bpy.ops.arapfields.bake(**given) == {"FINISHED"}
    made = bpy.context.object
    assert not bar.modifiers and made != bar and len(made.data.vertices) == len(bar.data.vertices)
    assert cache_modifier.is_playing(made) if kind == "PC2" else made.data.shape_keys is not None
