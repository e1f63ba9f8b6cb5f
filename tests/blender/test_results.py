# SPDX-License-Identifier: GPL-3.0-or-later
"""Where results go, and which of source, live shape and result is seen."""

import re
import tempfile

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes, stages
    from support.blender.live import step
    from support.blender.scenes import FIT

    import addon.deform.operators as deform
    from addon.core.errors import UserError
    from addon.core.runtime import jobs
    from addon.core.runtime.jobs import Pause, run_to_completion
    from addon.properties.choices import RESULT_ITEMS
    from addon.results.placement import placement_refusal

pytestmark = pytest.mark.in_blender

# Where results go: a new object, the source itself, a shape key of it; and what refuses them.


def test_replacing_moves_the_source_and_keeps_all_else():
    bar, _, moving = scenes.bar_with_handles()
    scenes.decorate(bar)
    before, points = scenes.everything(bar), scenes.world_points(bar)
    other = bpy.data.objects.new("Other", bar.data)
    bpy.context.collection.objects.link(other)
    bar.keyframe_insert("location", frame=1)
    moving.location.z += 0.4
    bpy.ops.arapfields.deform(result="REPLACE", **scenes.QUICK)
    moved = scenes.world_points(bar) - points
    assert scenes.everything(bar) == before
    assert np.abs(moved[points[:, 0] > 0.8].mean(axis=0) - [0, 0, 0.4]).max() < 0.1
    assert other.data != bar.data and np.array_equal(scenes.world_points(other), points)
    assert bar.animation_data.action is not None and "Bar_deformed" not in bpy.data.objects
    again = scenes.world_points(bar)
    bpy.ops.arapfields.deform(result="REPLACE", **scenes.QUICK)  # the handles are at rest now
    assert np.abs(scenes.world_points(bar) - again).max() < 0.02


def test_a_shape_key_of_the_source_carries_the_motion():
    bar, _, moving = scenes.bar_with_handles()
    before = scenes.world_points(bar)
    moving.location.z += 0.4
    for _ in range(2):
        bpy.ops.arapfields.deform(result="KEY", **scenes.QUICK)
        keys = bar.data.shape_keys.key_blocks
        assert [key.name for key in keys] == ["Basis", "ARAP Fields"]
        keys["ARAP Fields"].value = 0.0
        bpy.context.view_layer.update()
        assert np.array_equal(scenes.world_points(bar), before)
    keys["ARAP Fields"].value = 1.0
    bpy.context.view_layer.update()
    assert np.abs(scenes.world_points(bar) - before).max() > 0.3


def test_the_surface_can_take_the_sources_place():
    bar, _, moving = scenes.bar_with_handles()
    for name, value in FIT.items():
        setattr(bar.arapfields.fit, name, value)
    moving.location.z += 0.2
    count = len(bar.data.vertices)
    bpy.ops.arapfields.deform(result="REPLACE", output="SURFACE", resolution=40, **scenes.QUICK)
    assert len(bar.data.vertices) != count and len(bar.data.polygons) > 500
    assert len(bpy.data.objects) == 3


def test_the_earlier_name_of_result_still_counts():
    """Scripts say target= and object.arapfields.target; files of all versions store it under that name."""
    bar, _, moving = scenes.bar_with_handles()
    settings = bar.arapfields
    for key, *_ in RESULT_ITEMS:
        settings.target = key
        assert settings.result == key
    for key, *_ in RESULT_ITEMS:
        settings.result = key
        assert settings.target == key
    moving.location.z += 0.4
    assert bpy.ops.arapfields.deform(target="NEW", **scenes.QUICK) == {"FINISHED"}
    assert "Bar_deformed" in bpy.data.objects and not bar.modifiers


REFUSED = {
    "a key on a surface": "A shape key keeps the mesh",
    "a modifier": r"Bar has modifiers that change its vertices before \(Mirror\); apply them",
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_the_source_cannot_take_is_refused_before_the_work(case):
    bar, *_ = scenes.bar_with_handles()
    arguments = {"result": "KEY"}
    if case == "a key on a surface":
        arguments["output"] = "SURFACE"
    else:
        bar.modifiers.new("Mirror", "MIRROR")
    with pytest.raises(RuntimeError, match=REFUSED[case]):
        bpy.ops.arapfields.deform(**arguments, **scenes.QUICK)
    for name, value in arguments.items():
        setattr(bar.arapfields, name, value)
    assert re.search(REFUSED[case], str(placement_refusal(bar)))  # which a window tells before


def test_linked_objects_give_results_but_are_never_written():
    """From another file: deforming makes a local result; writing into the linked mesh is refused."""
    scenes.bar("Linked")
    path = tempfile.mktemp(suffix=".blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = ["Linked"]
    linked = into.objects[0]
    bpy.context.collection.objects.link(linked)
    bpy.context.view_layer.update()
    scenes.activate(linked)
    before = scenes.world_points(linked)
    with pytest.raises(RuntimeError, match="linked from another file"):
        bpy.ops.arapfields.add_handle()
    with pytest.raises(RuntimeError, match="linked from another file"):
        bpy.ops.arapfields.stylize(result="REPLACE", **scenes.QUICK)
    assert bpy.ops.arapfields.stylize(**scenes.NEW) == {"FINISHED"}
    result = bpy.data.objects["Linked_stylized"]
    assert result.library is None and result.data.library is None
    assert np.array_equal(scenes.world_points(linked), before)


def test_without_a_window_the_course_gives_what_blocking_gives():
    """Stepped as the window steps it, with a watched preview: the same bits as in one go."""
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.4
    bpy.ops.arapfields.deform(**scenes.NEW)
    blocking = scenes.world_points(bpy.data.objects["Bar_deformed"])
    for name, value in scenes.NEW.items():
        setattr(bar.arapfields.deform, name, value)
    scenes.activate(bar)
    operator, fraction = stages.Operator(deform.ARAPFIELDS_OT_deform, result="NEW"), 0.0
    operator.in_window = True
    coroutine = operator.coroutine(bpy.context)
    while True:
        try:
            if next(coroutine) is Pause.WORKER:
                jobs.running().join(0.001)
        except StopIteration as ended:
            assert ended.value == {"FINISHED"}
            break
        fraction = max(fraction, jobs.running().fraction)
    jobs.stop()
    assert np.array_equal(scenes.world_points(bpy.data.objects["Bar_deformed"]), blocking)
    assert fraction > 0.9  # the share done and "iteration 40 of 40" say the same


def test_what_a_worker_refuses_names_its_object_once():
    scenes.activate(scenes.bar())

    def refusing(error):
        def work(tracker):
            raise error

        operator = stages.Operator(deform.ARAPFIELDS_OT_deform, plan=lambda *_: jobs.Item("Bar", work))
        run_to_completion(operator.coroutine(bpy.context), wait=lambda: jobs.running().join(0.05))
        jobs.stop()
        return operator.said

    assert refusing(UserError("{name}: the mesh is empty", name="Bar")) == ["Bar: the mesh is empty"]
    assert refusing(ValueError("handles: none")) == ["Bar: handles: none"]


@pytest.mark.parametrize("way", ["warp", "surface", "keys"])
def test_a_result_looks_as_its_source_where_that_is_the_objects_own(way):
    bar, _, moving = scenes.bar_with_handles()
    scenes.decorate(bar)
    slot, other = bar.material_slots[0], bpy.data.materials.new("Other")
    slot.link, slot.material = "OBJECT", other
    bar.color, bar.pass_index, bar.visible_shadow, bar.is_holdout = (1, 0, 0, 1), 4, False, True
    for frame, height in ((1, 0.0), (2, 0.3)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    if way == "keys":
        bpy.ops.arapfields.bake(start=1, end=2, format="KEYS")
    else:
        bar.arapfields.surface, resolution = "EXACT", {"resolution": 32} if way == "surface" else {}
        bpy.ops.arapfields.deform(output=way.upper(), **scenes.NEW, **resolution)
    (result,) = (entry.item for entry in bar.arapfields.results)
    assert [one.material.name for one in result.material_slots] == ["Other", "two"]
    assert bar.data.materials[0].name == "one"
    looks = tuple(result.color), result.pass_index, result.visible_shadow, result.is_holdout
    assert looks == ((1, 0, 0, 1), 4, False, True)


# Of a source, its live shape and its results, one is seen in one place, and the one that it seems to be.


def seen():
    """Names of the meshes in the viewport, which are those in renders."""
    meshes = [item for item in bpy.context.scene.objects if item.type == "MESH"]
    shown = [item.name for item in meshes if item.visible_get()]
    assert shown == [item.name for item in meshes if not item.hide_render]
    return shown


def test_each_result_takes_the_place_of_the_one_before():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**scenes.NEW)
    assert seen() == ["Bar_deformed"] and "Bar is hidden" in jobs.messages()[-1][1]
    bpy.ops.arapfields.stylize(style="CUBE", **scenes.NEW)
    assert seen() == ["Bar_stylized"] and "Bar_deformed is hidden" in jobs.messages()[-1][1]
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**scenes.NEW)
    assert seen() == ["Bar_deformed"]
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**scenes.QUICK, result="MODIFIER")
    assert seen() == ["Bar"] and bar.modifiers


def test_what_the_user_has_moved_aside_or_hidden_stays_so():
    bar, *_ = scenes.bar_with_handles()
    bpy.ops.arapfields.deform(**scenes.NEW)
    bpy.data.objects["Bar_deformed"].location.y = 2.0
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.stylize(style="CUBE", **scenes.NEW)
    assert seen() == ["Bar_deformed", "Bar_stylized"]
    bpy.data.objects.remove(bpy.data.objects["Bar_stylized"])
    bpy.data.objects.remove(bpy.data.objects["Bar_deformed"])
    bar.arapfields.set_aside = False  # hidden by the user
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**scenes.QUICK, result="MODIFIER")
    assert seen() == []


@pytest.mark.parametrize("output", ["WARP", "REMESH"])
def test_what_a_live_result_measures_is_that_of_its_present_shape(output):
    """An array's steps are as long as the mesh, whose size Blender keeps until it is told of a change."""
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.result, bar.arapfields.output, bar.arapfields.resolution = "NEW", output, 20
    bpy.ops.arapfields.live()
    step()
    result = bpy.data.objects["Bar_live"]
    result.modifiers.new("Array", "ARRAY")
    bpy.context.view_layer.update()
    assert result.bound_box[6][0] > 0
    moving.location.x += 0.5
    step()
    shown = scenes.world_points(result)
    own = np.array([vertex.co for vertex in result.data.vertices])
    assert np.isclose(np.ptp(shown[:, 0]), 2 * np.ptp(own[:, 0]), rtol=1e-5)


def test_live_mode_shows_its_shape_alone_and_gives_back_what_was_seen():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**scenes.NEW)
    for target, shown in (("NEW", "Bar_live"), ("MODIFIER", "Bar")):
        bar.arapfields.result = target
        scenes.activate(bar)
        bpy.ops.arapfields.live()
        step()
        assert seen() == [shown]
        bpy.ops.arapfields.live()
        assert seen() == ["Bar_deformed"] and not bar.modifiers
    bpy.ops.arapfields.live()
    step()
    bpy.ops.arapfields.live_keep()
    assert seen() == ["Bar"] and bar.modifiers


def test_a_render_sees_the_source_again_when_it_takes_the_result_itself():
    """A deleted result leaves its source hidden in renders, which Alt H does not undo."""
    bar, *_ = scenes.bar_with_handles()
    bpy.ops.arapfields.deform(**scenes.NEW)
    bpy.data.objects.remove(bpy.data.objects["Bar_deformed"])
    bar.hide_set(False)
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**scenes.QUICK, result="MODIFIER")
    assert seen() == ["Bar"]


@pytest.mark.parametrize("way", ["excluded", "collection", "eye", "disabled"])
def test_a_source_stays_where_its_result_cannot_be_seen(way):
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.deform(**scenes.NEW)
    result = bpy.data.objects["Bar_deformed"]
    before = scenes.world_points(result)
    home = bpy.context.view_layer.layer_collection.children[result.users_collection[0].name]
    if way == "excluded":
        home.exclude = True
    elif way == "collection":
        home.hide_viewport = True
    elif way == "eye":
        result.hide_set(True)
    else:
        result.hide_viewport = True
    bar.hide_set(False)
    bar.hide_render = False
    moving.location.z += 0.4
    scenes.activate(bar)
    assert bpy.ops.arapfields.deform(**scenes.NEW) == {"FINISHED"}
    assert "(Bar_deformed is hidden)" in jobs.messages()[-1][1]
    assert bar.visible_get() and not bar.hide_render and not result.visible_get()
    home.exclude = home.hide_viewport = result.hide_viewport = False
    result.hide_set(False)
    assert scenes.world_points(result)[:, 2].max() > before[:, 2].max() + 0.3


def test_a_linked_object_does_not_point_to_its_result():
    """Undo leaves linked data as it is: a pointer there to what undo removes crashed Blender."""
    bpy.context.preferences.edit.use_global_undo = True
    linked = scenes.from_another_file(scenes.bar())[0]
    scenes.activate(linked)
    bpy.ops.ed.undo_push(message="linked")
    assert bpy.ops.arapfields.extract(surface="EXACT", resolution=32) == {"FINISHED"}
    assert "Bar_implicit" in bpy.data.objects and not linked.arapfields.results
    bpy.ops.ed.undo_push(message="extracted")
    bpy.ops.ed.undo()
    bpy.context.view_layer.update()
    assert "Bar_implicit" not in bpy.data.objects


def with_result():
    """(bar, its result, a duplicate of the bar with handles of its own, aside)."""
    bar, *_ = scenes.bar_with_handles()
    bpy.ops.arapfields.deform(result="NEW", **scenes.QUICK)
    result = bpy.data.objects["Bar_deformed"]
    bar.hide_set(False)
    scenes.activate(bar, *(entry.empty for entry in bar.arapfields.handles))
    bpy.context.view_layer.objects.active = bar
    bpy.ops.object.duplicate()
    copied = bpy.data.objects["Bar.001"]
    return bar, result, copied


def test_a_duplicate_has_results_of_its_own():
    """Its list names those of the object of which it is the copy; these stay."""
    bar, result, copied = with_result()
    mesh, place = result.data, result.location.copy()
    for item in (copied, *(entry.empty for entry in copied.arapfields.handles)):
        item.location.y += 5.0
    bpy.context.view_layer.update()
    scenes.activate(copied)
    bpy.ops.arapfields.deform(result="NEW", **scenes.QUICK)
    assert result.data == mesh and result.location == place
    assert [entry.item for entry in bar.arapfields.results] == [result]
    (entry,) = copied.arapfields.results
    assert entry.item != result and abs(entry.item.location.y - 5.0) < 1e-6


def test_live_mode_of_a_duplicate_hides_no_result_of_another():
    """A duplicate at the same place."""
    _, result, copied = with_result()
    scenes.activate(copied)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    assert not result.hide_get() and not result.hide_render
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    assert not result.hide_get() and not result.hide_render
