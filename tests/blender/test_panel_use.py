# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel by use: what is in view at first, what a button would refuse, what a fit and a job tell."""

import json

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.panels import Layout, drawn, prepared

    from addon.core.runtime import jobs
    from addon.handles import empties
    from addon.jobs import status_bar
    from addon.live import sessions

pytestmark = pytest.mark.in_blender


def test_everyday_sections_come_first_and_numbers_are_under_advanced():
    prepared("handles")
    jobs.add_message("INFO", "Bar: done")
    shown_texts = drawn()
    jobs.board.messages.clear()
    panels = {name: getattr(bpy.types, name) for name in shown_texts if "_PT_" in name}
    first = {n: cls.bl_order for n, cls in panels.items() if not hasattr(cls, "bl_parent_id")}
    folded = ["carried", "contact", "poses", "animation", "advanced"]
    order = ["tasks", "handles", "deform", "stylize", "wrap", "skin", *folded, "status"]
    assert sorted(first, key=first.get) == [f"ARAPFIELDS_PT_{name}" for name in order]
    closed = {name for name, cls in panels.items() if "DEFAULT_CLOSED" in getattr(cls, "bl_options", ())}
    assert closed == {*panels} - {*first} | {f"ARAPFIELDS_PT_{name}" for name in folded}
    jargon = {"Samples", "Iterations", "Handle Weight", "Geometry", "Resolution", "No Limit"}
    for name, texts in shown_texts.items():
        if name in first:
            assert not jargon & {*texts}, name
    assert jargon <= {text for texts in shown_texts.values() for text in texts}


def test_advanced_shows_what_counts_for_the_method_alone():
    deform = scenes.bar().arapfields.deform
    for field, fall_off, shown in (("auto", False, set()), ("radial", True, {"Falloff"})):
        deform.field, deform.exact_handles = field, fall_off
        texts = {*drawn()["ARAPFIELDS_PT_deform_settings"]}
        assert texts & {"Falloff", "Network Width", "Start", "Optimizer"} == shown and "Iterations" in texts
    for field, start in (("neural", True), ("invertible", False)):
        deform.field = field
        texts = {*drawn()["ARAPFIELDS_PT_deform_settings"]}
        assert {"Network Width", "Optimizer"} <= texts and ("Start" in texts) == start
    deform.field, deform.width = "auto", 64  # which makes the method neural
    assert "Network Width" in drawn()["ARAPFIELDS_PT_deform_settings"]


def test_a_switch_stands_for_zero_and_numbers_go_one_way():
    style = scenes.bar().arapfields.stylize
    assert style.sharpness_is_zero and style.sharpness == 0.0
    style.sharpness_is_zero = False
    assert style.sharpness == style.sharpness_above_zero == 8.0
    style.sharpness_above_zero = 0.0  # nearly off, and not automatic
    assert 0 < style.sharpness < 0.01 and not style.sharpness_is_zero
    style.sharpness = 9.0  # as scripts and files say it
    assert style.sharpness_above_zero == 9.0 and not style.sharpness_is_zero
    for frame, value in ((1, 2.0), (11, 4.0)):
        style.sharpness_above_zero = value
        style.keyframe_insert("sharpness_above_zero", frame=frame)
    bpy.context.scene.frame_set(6)
    assert 2.5 < style.sharpness < 3.5
    style.sharpness_is_zero = True
    assert style.sharpness == 0.0


REFUSED = {
    "no handle": ("ARAPFIELDS_PT_deform", "Drag a pin or add a handle first"),
    "no group": ("ARAPFIELDS_PT_deform", "Bar has no vertex group gone"),
    "holds nothing": ("ARAPFIELDS_PT_deform", "No part of the surface lies in the rest region of Far"),
    "no style object": ("ARAPFIELDS_PT_stylize", "Choose the object that gives the style its normals"),
    "no axes": ("ARAPFIELDS_PT_stylize", "Choose the object along whose axes the style stands"),
    "no region": ("ARAPFIELDS_PT_stylize", "Bar has no vertex group gone"),
    "follows no handle": ("ARAPFIELDS_PT_stylize", "Drag a pin or add a handle first"),
    "no faces": ("ARAPFIELDS_PT_source", "Bar: the mesh has no faces"),
    "empty": ("ARAPFIELDS_PT_source", "Bar: the mesh is empty"),
    "a key of a surface": ("ARAPFIELDS_PT_stylize", "A shape key keeps the mesh"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_a_button_would_refuse_is_said_before(case):
    bar = scenes.bar()
    ours = bar.arapfields
    if case == "no group":
        bar.vertex_groups.new(name="gone").add([0, 1], 1.0, "REPLACE")
        bpy.ops.arapfields.add_handle(kind="GROUP", group="gone")
        bar.vertex_groups.clear()
    elif case == "holds nothing":
        scenes.activate(scenes.cube_empty((30, 0, 0), (1, 1, 1), "Far"), bar)
        bpy.context.view_layer.update()
        bpy.ops.arapfields.add_handle()
    elif case == "no style object":
        ours.stylize.style = "OBJECT"
    elif case == "no axes":
        ours.stylize.frame = "EMPTY"
    elif case == "no region":
        ours.stylize.region = "gone"
    elif case == "follows no handle":
        ours.stylize.use_handles = True
    elif case in ("no faces", "empty"):
        points = [] if case == "empty" else [vertex.co for vertex in bar.data.vertices]
        bar.data.clear_geometry()
        bar.data.from_pydata(points, [], [])
    elif case == "a key of a surface":
        ours.output, ours.result = "SURFACE", "KEY"
    section, text = REFUSED[case]
    assert text in " ".join(drawn()[section])


def test_what_the_panel_refuses_the_operators_refuse_too():
    bar = scenes.bar()
    points = [vertex.co for vertex in bar.data.vertices]
    bar.data.clear_geometry()
    bar.data.from_pydata(points, [], [])
    for operator in ("deform", "stylize", "fit", "extract", "bake", "live"):
        with pytest.raises(RuntimeError, match="Bar: the mesh has no faces"):
            getattr(bpy.ops.arapfields, operator)()
        assert not getattr(bpy.ops.arapfields, operator).poll()


def test_a_menu_offers_what_the_mesh_has():
    bar = scenes.bar()
    assert not empties.can_place(None, "CUBE", "CURSOR")
    assert empties.can_place(bar, "CUBE", "CURSOR") and not empties.can_place(bar, "GROUP", "AUTO")
    bar.vertex_groups.new(name="one")
    assert empties.can_place(bar, "GROUP", "AUTO")
    bpy.ops.object.mode_set(mode="EDIT")
    for action in ("SELECT", "DESELECT"):
        bpy.ops.mesh.select_all(action=action)
        assert empties.can_place(bar, "CUBE", "SELECTION") == (action == "SELECT")
    bpy.ops.object.mode_set(mode="OBJECT")


def test_a_fit_tells_its_errors():
    prepared("fitted")
    texts = drawn()["ARAPFIELDS_PT_surface"]
    errors = [text for text in texts if "error at the surface" in text]
    report = json.loads(bpy.data.objects["Bar"].arapfields.fit_report)
    assert errors == [
        f"Mean error at the surface: {report['near_mean']:.2g}",
        f"Largest error at the surface: {report['near_max']:.2g}",
    ]
    assert 0 < report["near_mean"] < report["near_max"]


def test_the_status_bar_shows_the_job_and_its_cancel():
    def texts():
        labels = []
        status_bar.draw(type("Header", (), {"layout": Layout(labels)})(), bpy.context)
        return labels

    assert texts() == []
    undo = prepared("running")
    try:
        assert texts() == ["Bar", "Deform 0%", "Cancel"]
    finally:
        undo()
    assert texts() == []
    assert status_bar.draw in bpy.types.STATUSBAR_HT_header.draw._draw_funcs


@pytest.mark.parametrize("field", ["auto", "radial", "neural"])
def test_the_fold_barrier_acts_on_every_field(field):
    _, _, moving = scenes.bar_with_handles()
    moving.location.x -= 1.2  # the bar is pressed together
    bpy.context.view_layer.update()
    shapes = []
    for barrier in (0.0, 50.0):
        assert bpy.ops.arapfields.deform(**scenes.QUICK, field=field, barrier=barrier) == {"FINISHED"}
        shapes.append(scenes.world_points(bpy.data.objects["Bar"]))
    assert abs(shapes[1] - shapes[0]).max() > 1e-3


def test_one_button_poses_and_one_undoes_it():
    bar, _, moving = scenes.bar_with_handles()
    rest = scenes.world_points(bar)
    assert {"Pose"} <= {*drawn()["ARAPFIELDS_PT_deform"]} and "Factor" not in drawn()["ARAPFIELDS_PT_deform"]
    moving.location.z += 0.5
    bpy.context.view_layer.update()
    for way in ("live", "finished"):
        assert bpy.ops.arapfields.live() == {"FINISHED"}
        texts = {*drawn()["ARAPFIELDS_PT_deform"]}
        assert "Finish Pose" in texts and not texts & {"Pose", "Keep Shape", "Live Deform", "Deform"}
        if way == "finished":
            assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
            assert not sessions.is_live(bar) and "Pose" in drawn()["ARAPFIELDS_PT_deform"]
            assert "Factor" in drawn()["ARAPFIELDS_PT_deform"]
        assert abs(scenes.world_points(bar) - rest).max() > 0.3
        assert bpy.ops.arapfields.remove_result(kind="DEFORM") == {"FINISHED"}
        assert not bar.modifiers and not sessions.is_live(bar)
        assert (scenes.world_points(bar) == rest).all()
    assert not bpy.ops.arapfields.remove_result.poll()


def test_a_pose_by_pins_goes_with_one_press():
    """What a drag keeps is removed too, and what it lies on stays."""
    bar, _, moving = scenes.bar_with_handles()
    rest = scenes.world_points(bar)
    sessions.begin(bpy.context, bar, keeps_shape=True)
    moving.location.z += 0.5
    bpy.context.view_layer.update()
    sessions.settle(bpy.context, bar.session_uid)
    assert abs(scenes.world_points(bar) - rest).max() > 0.3
    assert bpy.ops.arapfields.remove_result(kind="DEFORM") == {"FINISHED"}
    assert not bar.modifiers and (scenes.world_points(bar) == rest).all()


def test_each_result_is_removed_where_it_is_made():
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.stylize(style="CUBE", **scenes.QUICK)
    styled = scenes.world_points(bar)
    moving.location.z += 0.5
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**scenes.QUICK)
    shown = drawn()
    for section in ("deform", "stylize"):
        assert "Factor" in shown[f"ARAPFIELDS_PT_{section}"], section
    assert "Factor" not in shown["ARAPFIELDS_PT_wrap"]
    with pytest.raises(RuntimeError, match="Another result of Bar lies on this one"):
        bpy.ops.arapfields.remove_result(kind="STYLIZE")
    with pytest.raises(RuntimeError, match="Bar has no such result"):
        bpy.ops.arapfields.remove_result(kind="WRAP")
    bpy.ops.arapfields.remove_result(kind="DEFORM")
    assert (scenes.world_points(bar) == styled).all() and len(bar.modifiers) == 1
    bpy.ops.arapfields.remove_result(kind="STYLIZE")
    assert not bar.modifiers


def test_what_is_seldom_used_is_under_advanced():
    scenes.bar_with_handles()
    shown = drawn()
    seldom = {"Contact Sheet", "Wrap Sequence", "Field as Nodes", "Exact Handles", "Weight"}
    everyday = [
        name for name in shown if "_PT_" in name and not hasattr(getattr(bpy.types, name), "bl_parent_id")
    ]
    assert not seldom & {text for name in everyday for text in shown[name]}
    assert seldom <= {text for texts in shown.values() for text in texts}
