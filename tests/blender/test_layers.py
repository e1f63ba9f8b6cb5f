# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of fields."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

import arapfields

if IN_BLENDER:
    import bpy
    from support.blender import panels, scenes, wraps
    from support.blender.live import WAIT, pin, state, step
    from support.blender.stacks import QUICK, SAME, STYLE, structure, styled, with_handles

    from addon.blender import modifier_stack
    from addon.core.runtime import jobs
    from addon.field_modifier import cache_modifier, layers, motion
    from addon.live import sessions
    from addon.pin_tool import drag
    from addon.results import placement
    from addon.solver import frame_solver

pytestmark = pytest.mark.in_blender

# What moves an object further acts on what a style has made of it, and nothing of that is lost.


@pytest.mark.parametrize("stack", [(), ("MIRROR",), ("keys",), ("ARMATURE",)])
def test_deform_acts_on_the_styled_shape(stack):
    bar, shape, _ = styled(stack)
    before = structure(bar)
    moving = with_handles(bar)
    assert np.array_equal(scenes.world_points(bar), shape)
    alone = bpy.data.objects.new(
        "Alone", bpy.data.meshes.new_from_object(bar.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    )
    bpy.context.collection.objects.link(alone)
    moving.location.z += 0.5
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.deform(**QUICK) == {"FINISHED"}
    moved = scenes.world_points(bar)
    scenes.activate(alone)
    with_handles(alone).location.z += 0.5
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.deform(**QUICK) == {"FINISHED"}
    assert np.abs(moved - shape).max() > 0.3 and np.abs(moved - scenes.world_points(alone)).max() < 0.01
    scenes.activate(bar)
    assert bpy.ops.arapfields.deform(**QUICK) == {"FINISHED"}  # again: over the style, not over itself
    assert np.abs(scenes.world_points(bar) - moved).max() < SAME
    bpy.ops.arapfields.remove_field()
    assert np.array_equal(scenes.world_points(bar), shape)
    assert structure(bar)[:4] == before[:4]


@pytest.mark.parametrize(
    "run, given", [("deform", {"field": "radial"}), ("live", {}), ("bake", {"format": "KEYS"})]
)
def test_a_refused_run_leaves_a_layer_that_was_there_before(run, given):
    """A handle has made the style a layer; it holds nothing, so the run fails, and puts nothing back."""
    bar, shape, _ = styled()
    far = scenes.cube_empty((9, 0, 0), (0.3, 0.6, 0.6), "Far")
    bpy.context.view_layer.update()
    scenes.activate(far, bar)
    assert bpy.ops.arapfields.add_handle() == {"FINISHED"}
    scenes.activate(bar)
    before = structure(bar)[:4]
    assert layers.LAYER_GROUP in bar.modifiers[0].node_group
    with pytest.raises(RuntimeError, match="No part of the surface lies in"):
        getattr(bpy.ops.arapfields, run)(**given)
    bpy.context.view_layer.update()
    assert structure(bar)[:4] == before and np.array_equal(scenes.world_points(bar), shape)


def test_a_drag_over_a_style_is_cancelled_undone_and_deleted_bit_for_bit():
    frame_solver.SAMPLES = 500
    styled()
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="styled")
    bar = bpy.data.objects["Bar"]
    before, shape = (state(bar), structure(bar)), scenes.world_points(bar)
    place = shape[shape[:, 0].argmax()]
    dragged = drag.of_new_pin(bpy.context, bar, place, 0.15)
    dragged.move(bpy.context, place + np.array([0, 0, 0.3]))
    step()
    assert np.abs(scenes.world_points(bar) - shape).max() > 0.1
    dragged.cancel(bpy.context)
    assert (state(bar)[:5], structure(bar)) == (before[0][:5], before[1])
    pin(bar, place)
    assert np.array_equal(scenes.world_points(bar), shape)
    bpy.ops.ed.undo_push(message="placed")
    for name, target in (("dragged", 0.3), ("dragged again", 0.6)):
        bar = bpy.data.objects["Bar"]
        pin(bar, scenes.world_points(bar)[shape[:, 0].argmin()], target=shape[shape[:, 0].argmin()] + target)
        sessions.update(bpy.context, wait=WAIT, refined=True)
        bpy.ops.ed.undo_push(message=name)
    last = scenes.world_points(bpy.data.objects["Bar"])
    assert np.abs(last - shape).max() > 0.3
    for _ in range(2):
        for _ in range(3):
            bpy.ops.ed.undo()
            sessions.update(bpy.context, wait=WAIT, refined=True)
        bar = bpy.data.objects["Bar"]
        assert structure(bar) == before[1] and np.array_equal(scenes.world_points(bar), shape)
        for _ in range(3):
            bpy.ops.ed.redo()
            sessions.update(bpy.context, wait=WAIT, refined=True)
        assert np.array_equal(scenes.world_points(bpy.data.objects["Bar"]), last)
    bar = bpy.data.objects["Bar"]
    for entry in list(bar.arapfields.handles):
        scenes.activate(bar.arapfields.handles[0].empty)
        assert entry is not None and bpy.ops.arapfields.pin_delete() == {"FINISHED"}
    assert structure(bar) == before[1] and np.array_equal(scenes.world_points(bar), shape)


@pytest.mark.parametrize("live_style", [False, True])
def test_live_over_a_style_ends_with_it(live_style):
    frame_solver.SAMPLES = 500
    bar, shape, _ = styled()
    moving = with_handles(bar)
    if live_style:
        bpy.ops.arapfields.remove_field()
        assert bpy.ops.arapfields.live(kind="STYLIZE") == {"FINISHED"}
        step(refined=True)
        shape = scenes.world_points(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    step(refined=True)
    assert np.abs(scenes.world_points(bar) - shape).max() < (SAME if not live_style else 0.02)
    moving.location.z += 0.4
    step(refined=True)
    moved = scenes.world_points(bar)
    assert np.abs(moved - shape).max() > 0.2
    bpy.ops.arapfields.live()
    assert np.abs(scenes.world_points(bar) - shape).max() < (SAME if not live_style else 0.02)
    bpy.ops.arapfields.live()
    step(refined=True)
    bpy.ops.arapfields.live_keep()
    assert np.abs(scenes.world_points(bar) - moved).max() < 0.01
    assert [layers.kind_in(layer) for layer in modifier_stack.layers(bar)] == ["STYLIZE"]


def fail(*_, **__):
    raise ValueError("no style")


@pytest.mark.parametrize("fails", [False, True])
def test_a_style_that_is_changed_takes_off_what_lies_over_it(fails):
    bar, shape, _ = styled()
    with_handles(bar).location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**QUICK)
    moved, before = scenes.world_points(bar), structure(bar)
    jobs.forget_messages()
    if fails:
        stylize, arapfields.stylize = arapfields.stylize, fail
        try:
            with pytest.raises(RuntimeError, match="no style"):
                bpy.ops.arapfields.stylize(**STYLE)
        finally:
            arapfields.stylize = stylize
    else:
        assert bpy.ops.arapfields.stylize(**STYLE) == {"FINISHED"}
        assert "Bar: this takes the pose off; press Pose afterwards to have it again" in str(jobs.messages())
        assert np.abs(scenes.world_points(bar) - shape).max() < SAME and len(bar.modifiers) == 1
        assert bpy.ops.arapfields.deform(**QUICK) == {"FINISHED"}
    assert np.abs(scenes.world_points(bar) - moved).max() < SAME and structure(bar) == before


def test_before_a_style_is_made_the_panel_says_that_it_takes_a_live_pose_off():
    bar, _, _ = styled()
    with_handles(bar).location.z += 0.4
    bpy.ops.arapfields.live(kind="DEFORM")
    step(refined=True)
    shown = " ".join(panels.drawn()["ARAPFIELDS_PT_stylize"])
    assert "this takes the pose off" in shown
    jobs.forget_messages()
    bpy.ops.arapfields.stylize(**STYLE)
    assert "this takes the pose off" in str(jobs.messages())
    bpy.ops.arapfields.live(kind="DEFORM")
    step(refined=True)
    shown = panels.drawn()
    assert "this " not in " ".join(shown["ARAPFIELDS_PT_deform"])
    assert len(bar.modifiers) == 2  # the pose lies on the style


def test_a_result_that_a_style_below_has_no_place_for_is_refused_before_the_solve():
    """The style, which the deformation acts on, is a layer then, and what lies on it makes the vertices."""
    bar, _, _ = styled()
    with_handles(bar).location.z += 0.4
    bpy.ops.arapfields.stylize(**STYLE)
    shape = scenes.world_points(bar)
    bar.modifiers.new("Lattice", "LATTICE")
    bpy.context.view_layer.update()
    before, deform = structure(bar), arapfields.deform
    arapfields.deform = fail
    try:
        with pytest.raises(RuntimeError, match=r"has modifiers that change its vertices before \(Lattice\)"):
            bpy.ops.arapfields.deform(result="KEY", **QUICK)
    finally:
        arapfields.deform = deform
    assert structure(bar) == before and np.array_equal(scenes.world_points(bar), shape)


@pytest.mark.parametrize("run", ["deform", "stylize"])
def test_a_result_that_is_not_placed_leaves_the_layers(run):
    """The mesh may have changed while the worker solved. Node groups are the former ones: undo would leave
    modifiers with references to new ones, which no step has."""
    bar, _, _ = styled()
    with_handles(bar).location.z += 0.4
    bpy.context.view_layer.update()
    if run == "stylize":  # takes the deformation off the style
        bpy.ops.arapfields.deform(**QUICK)
    else:  # acts on the style, which is a layer meanwhile
        bpy.ops.arapfields.stylize(**STYLE)
    before, shape, put = structure(bar), scenes.world_points(bar), placement.place_result
    groups = [modifier.node_group.session_uid for modifier in bar.modifiers]
    placement.place_result = fail
    try:
        with pytest.raises(RuntimeError, match="no style"):
            getattr(bpy.ops.arapfields, run)(**QUICK)
    finally:
        placement.place_result = put
    assert [modifier.node_group.session_uid for modifier in bar.modifiers] == groups
    assert structure(bar) == before and np.abs(scenes.world_points(bar) - shape).max() < SAME


def test_of_several_empties_none_is_a_handle_where_one_is_refused():
    bar, shape, _ = styled()
    usable, flat = (scenes.cube_empty((x, 0, 0), (0.3, 0.6, 0.6), str(x)) for x in (-1, 1))
    flat.scale.x = 0.0
    bpy.context.view_layer.update()
    before = structure(bar)
    scenes.activate(usable, flat, bar)
    with pytest.raises(RuntimeError, match="is flat"):
        bpy.ops.arapfields.add_handle()
    assert structure(bar) == before and np.array_equal(scenes.world_points(bar), shape)
    assert not bar.arapfields.handles and usable.parent is None


@pytest.mark.parametrize("way", ["box", "pin"])
def test_handles_that_are_added_while_a_style_is_live_leave_it_live(way):
    bar, _, _ = styled()
    bpy.ops.arapfields.remove_field()
    assert bpy.ops.arapfields.live(kind="STYLIZE") == {"FINISHED"}
    step(refined=True)
    shape = scenes.world_points(bar)
    if way == "box":
        with_handles(bar)
    else:
        assert bpy.ops.arapfields.pin_add(location=shape[0], radius=0.1) == {"FINISHED"}
    step(refined=True)
    assert sessions.is_live(bar, "STYLIZE") and np.array_equal(scenes.world_points(bar), shape)
    moving = bar.arapfields.handles[-1].empty
    scenes.activate(bar)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    moving.location.z += 0.3
    step(refined=True)
    assert np.abs(scenes.world_points(bar) - shape).max() > 0.02 and len(modifier_stack.layers(bar)) == 1


@pytest.mark.parametrize("last", ["stylize", "wrap", "live"])
@pytest.mark.parametrize("kind", ["PC2", "MDD"])
def test_what_was_baked_gives_way_to_a_new_run_below(tmp_path, kind, last):
    """Both results below the bake's modifier go, which is off then: nothing waits for its removal."""
    bar, _, _ = styled()
    with_handles(bar).location.z += 0.3
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**QUICK)
    given = {"range": "CUSTOM", "start": 1, "end": 2}
    assert bpy.ops.arapfields.bake(folder=str(tmp_path), format=kind, **given) == {"FINISHED"}
    assert [len(modifier_stack.layers(bar)), cache_modifier.is_playing(bar)] == [1, True]
    if last == "wrap":
        bar.arapfields.wrap.onto = scenes.bar("Target")
        bpy.data.objects["Target"].scale.y = 1.5
        bpy.context.view_layer.update()
        scenes.activate(bar)
        run, given = bpy.ops.arapfields.wrap, {"samples": 300, "centers": 20, "stages": 1, "iterations": 2}
    elif last == "live":
        run, given = bpy.ops.arapfields.live, {"kind": "STYLIZE"}
    else:
        run, given = bpy.ops.arapfields.stylize, STYLE
    assert run(**given) == {"FINISHED"}
    assert not modifier_stack.layers(bar) and not cache_modifier.is_playing(bar)
    assert sum(map(modifier_stack.is_field, bar.modifiers)) == 1
    if last == "live":
        scenes.activate(bar)
        assert bpy.ops.arapfields.live(kind="STYLIZE") == {"FINISHED"}
        assert len(modifier_stack.layers(bar)) == 1 and cache_modifier.is_playing(bar)


@pytest.mark.parametrize("result", ["REPLACE", "KEY"])
def test_a_result_on_the_mesh_takes_off_layers_below_a_bake(tmp_path, result):
    bar, _, _ = styled()
    with_handles(bar).location.z += 0.3
    bpy.context.view_layer.update()
    given = {"range": "CUSTOM", "start": 1, "end": 2, "folder": str(tmp_path), "format": "PC2"}
    assert bpy.ops.arapfields.bake(**given) == {"FINISHED"}
    assert bpy.ops.arapfields.deform(**QUICK, result=result) == {"FINISHED"}
    assert modifier_stack.find(bar) is None and len(modifier_stack.layers(bar)) == (result == "KEY")


# Styles and wraps below deformations: every kind of result, bakes, copies, armatures.


@pytest.mark.parametrize("result", ["NEW", "REPLACE", "KEY"])
def test_every_kind_of_result_is_that_of_the_modifier(result):
    bar, shape, rest = styled()
    with_handles(bar).location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**QUICK)
    moved = scenes.world_points(bar)
    bpy.ops.arapfields.remove_field()
    assert bpy.ops.arapfields.deform(result=result, **QUICK) == {"FINISHED"}
    found = bpy.data.objects["Bar_deformed"] if result == "NEW" else bar
    assert np.abs(scenes.world_points(found) - moved).max() < SAME
    kept = {"NEW": shape, "REPLACE": moved, "KEY": moved}[result]
    assert np.abs(scenes.world_points(bar) - kept).max() < SAME
    assert len(bar.modifiers) == (0 if result == "REPLACE" else 1)
    if result == "KEY":
        bar.data.shape_keys.key_blocks["ARAP Fields"].value = 0.0
        assert np.abs(scenes.world_points(bar) - shape).max() < SAME
    assert bar.arapfields.moved_by == ("" if result == "REPLACE" else "STYLIZE")
    assert len(rest) == len(shape)


def test_a_style_with_handles_or_riders_is_replaced_and_that_is_said():
    bar, _, _ = styled()
    hat = scenes.cube_empty((0, 0, 0.5), (0.1, 0.1, 0.1), "Hat")
    scenes.activate(hat, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    scenes.activate(bar)
    bpy.ops.arapfields.stylize(**STYLE)
    with_handles(bar).location.z += 0.4
    bpy.context.view_layer.update()
    jobs.forget_messages()
    assert bpy.ops.arapfields.deform(**QUICK) == {"FINISHED"}
    assert "Bar: this replaces the result of Stylize" in str(jobs.messages()) and len(bar.modifiers) == 1
    bpy.ops.arapfields.release()
    bar.arapfields.stylize.use_handles = True
    bpy.ops.arapfields.stylize(**STYLE)
    assert bar.arapfields.moved_by == layers.POSED
    posed = scenes.world_points(bar)
    pin(bar, posed[0])
    assert sessions.is_live(bar, "STYLIZE") and np.array_equal(scenes.world_points(bar), posed)


def test_a_bake_plays_over_the_style(tmp_path):
    bar, shape, _ = styled()
    moving = with_handles(bar)
    moving.keyframe_insert("location", frame=1)
    moving.location.z += 0.4
    moving.keyframe_insert("location", frame=4)
    bpy.context.scene.frame_set(1)
    assert bpy.ops.arapfields.bake(filepath=str(tmp_path / "a.pc2"), start=1, end=4) == {"FINISHED"}
    assert [m.type for m in bar.modifiers] == ["NODES", "MESH_CACHE"]
    bpy.context.scene.frame_set(1)
    assert np.abs(scenes.world_points(bar) - shape).max() < 1e-5
    bpy.context.scene.frame_set(4)
    baked = scenes.world_points(bar)
    bpy.ops.arapfields.live()
    step(refined=True)
    assert np.abs(scenes.world_points(bar) - baked).max() < 0.02 and np.abs(baked - shape).max() > 0.2
    bpy.ops.arapfields.live()
    assert bpy.ops.arapfields.remove_bake() == {"FINISHED"}
    assert np.array_equal(scenes.world_points(bar), shape)


def test_a_copy_keeps_its_layers():
    bar, shape, _ = styled()
    with_handles(bar).location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**QUICK)
    moved = scenes.world_points(bar)
    for linked in (False, True):
        scenes.activate(bar)
        bpy.ops.object.duplicate(linked=linked)
        copied = bpy.context.object
        assert np.array_equal(scenes.world_points(copied), moved)
        assert bpy.ops.arapfields.remove_field() == {"FINISHED"}
        assert np.array_equal(scenes.world_points(copied), shape)
        assert np.array_equal(scenes.world_points(bar), moved)
    assert motion.snapshot(bar).offsets is not None


def test_bones_that_a_wrap_has_fitted_pose_the_wrapped_shape():
    """As handles, too; and what the wrap has made stays when these go."""
    item, rig = wraps.rigged_bar()
    item.arapfields.wrap.onto = wraps.soup_of(item)
    assert bpy.ops.arapfields.wrap(**wraps.SMALL) == {"FINISHED"}
    wrapped, before = scenes.world_points(item), structure(item)
    bones = wraps.joints(rig, posed=False)
    assert before[3]
    scenes.activate(rig, item)
    assert bpy.ops.arapfields.add_bones() == {"FINISHED"}
    scenes.activate(item)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    step(refined=True)
    size = np.ptp(wrapped, axis=0).max()
    assert np.abs(scenes.world_points(item) - wrapped).max() < 1e-4 * size
    rig.pose.bones["Upper"].rotation_mode = "XYZ"
    rig.pose.bones["Upper"].rotation_euler.x = 0.4
    step(refined=True)
    assert np.abs(scenes.world_points(item) - wrapped).max() > 0.05 * size
    bpy.ops.arapfields.live()
    rig.pose.bones["Upper"].rotation_euler.x = 0.0
    bpy.context.view_layer.update()
    assert structure(item) == before and np.array_equal(scenes.world_points(item), wrapped)
    assert bpy.ops.arapfields.stylize(**STYLE) == {"FINISHED"}
    assert [m.type for m in item.modifiers] == ["NODES", "ARMATURE", "NODES"]
    assert np.array_equal(wraps.joints(rig, posed=False), bones)
    while len(item.arapfields.handles):
        bpy.ops.arapfields.remove_handle()
    for left in (2, 1):
        assert bpy.ops.arapfields.remove_field() == {"FINISHED"} and len(item.modifiers) == left
    assert not np.allclose(wraps.joints(rig, posed=False), bones)
