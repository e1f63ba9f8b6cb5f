# SPDX-License-Identifier: GPL-3.0-or-later
"""Deforming inside Blender: what moves, what stays, in whichever space the object lives."""

import math

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.live import step

    from addon.core.runtime import jobs
    from addon.deform import solve_job

pytestmark = pytest.mark.in_blender

ON_SOURCE = 2e-6  # single precision of positions of size one


def test_the_moved_end_follows_and_the_held_end_stays():
    bar, _, moving = scenes.bar_with_handles()
    before = scenes.world_points(bar)
    moving.location.z += 0.4
    assert bpy.ops.arapfields.deform(output="WARP", **scenes.NEW | {"iterations": 120}) == {"FINISHED"}
    after = scenes.world_points(bpy.data.objects["Bar_deformed"])
    shift = after - before
    assert np.abs(shift[before[:, 0] < -0.8]).max() < 0.08
    assert np.abs(shift[before[:, 0] > 0.8] - [0, 0, 0.4]).max() < 0.12
    assert np.array_equal(scenes.world_points(bar), before)


def test_unmoved_handles_give_the_shape_itself():
    bar, *_ = scenes.bar_with_handles()
    before = scenes.world_points(bar)
    bpy.ops.arapfields.deform(output="WARP", **scenes.NEW)
    assert np.abs(scenes.world_points(bpy.data.objects["Bar_deformed"]) - before).max() < 5e-3


def test_everything_but_positions_is_byte_equal():
    bar, _, moving = scenes.bar_with_handles()
    scenes.decorate(bar)
    before = scenes.everything(bar)
    moving.location.z += 0.4
    bpy.ops.arapfields.deform(output="WARP", **scenes.NEW)
    result = bpy.data.objects["Bar_deformed"]
    assert scenes.everything(result) == before and len(before) > 12
    assert result.data != bar.data and scenes.everything(bar) == before


def test_shape_keys_stay_and_the_motion_is_one_more():
    bar, _, moving = scenes.bar_with_handles()
    bar.shape_key_add(name="Basis")
    key = bar.shape_key_add(name="Fat")
    for point in key.data:
        point.co.y *= 1.5
    key.value = 0.5
    bpy.context.view_layer.update()
    flat = np.empty(3 * len(key.data), np.float32)
    key.data.foreach_get("co", flat)
    shown = scenes.world_points(bar)
    moving.location.z += 0.4
    bpy.ops.arapfields.deform(output="WARP", **scenes.NEW)
    result = bpy.data.objects["Bar_deformed"]
    keys = result.data.shape_keys.key_blocks
    assert [k.name for k in keys] == ["Basis", "Fat", "ARAP Fields"]
    kept = np.empty_like(flat)
    keys["Fat"].data.foreach_get("co", kept)
    assert np.array_equal(kept, flat) and keys["Fat"].value == 0.5
    moved = scenes.world_points(result)
    assert np.abs(moved - shown).max() > 0.1
    keys["ARAP Fields"].value = 0.0
    bpy.context.view_layer.update()
    assert np.abs(scenes.world_points(result) - shown).max() < 1e-6


def test_modifiers_are_read_and_the_result_is_what_was_shown():
    bar, _, moving = scenes.bar_with_handles()
    bar.modifiers.new("Subdivision", "SUBSURF").levels = 1
    before = scenes.world_points(bar)
    moving.location.z += 0.4
    bpy.ops.arapfields.deform(output="WARP", **scenes.NEW | {"iterations": 120})
    result = bpy.data.objects["Bar_deformed"]
    after = scenes.world_points(result)
    assert len(after) == len(before) > len(bar.data.vertices) and not result.modifiers
    assert np.abs((after - before)[before[:, 0] < -0.8]).max() < 0.08


def test_a_sculpted_mesh_is_moved_after_its_multires():
    """Blender lets nothing but deforming modifiers stand before one."""
    bar, _, moving = scenes.bar_with_handles()
    bar.modifiers.new("Multires", "MULTIRES")
    bpy.ops.object.multires_subdivide(modifier="Multires")
    bar.modifiers.new("Triangulate", "TRIANGULATE")
    before = scenes.world_points(bar)
    moving.location.z += 0.4
    assert bpy.ops.arapfields.deform(**scenes.QUICK | {"iterations": 120}) == {"FINISHED"}
    assert [modifier.type for modifier in bar.modifiers] == ["MULTIRES", "NODES", "TRIANGULATE"]
    after = scenes.world_points(bar)
    assert len(after) == len(before) > 2 * len(bar.data.vertices)
    assert np.abs(after - before)[before[:, 0] < -0.8].max() < 0.08
    assert np.abs(after - before - [0, 0, 0.4])[before[:, 0] > 0.8].max() < 0.12
    bpy.ops.arapfields.live()
    step()
    assert np.abs(scenes.world_points(bar) - after).max() < 0.05


PLACES = {
    "under an unevenly scaled parent": {"rotation_euler": (0.3, 0.5, 0.7), "parent": (2, 0.5, 1)},
    "moved and turned": {"location": (3, -2, 5), "rotation_euler": (0.3, 1.0, -2.0)},
    "mirrored": {"scale": (1, -1, 1)},
    "uneven": {"scale": (0.5, 2.0, 1.3), "rotation_euler": (0.3, 0.5, 0.7)},
    "tiny": {"scale": (1e-3, 1e-3, 1e-3)},
    "huge": {"scale": (1e3, 1e3, 1e3), "location": (1e3, 0, 0)},
}


@pytest.mark.parametrize("place", PLACES)
def test_a_result_lands_on_its_source_wherever_that_is(place):
    """One handle moves as a screw of the whole bar: the result is the rigidly moved bar."""
    bar = scenes.bar()
    for name, value in PLACES[place].items():
        if name == "parent":
            bar.parent = scenes.cube_empty((1, 2, 3), value, "Parent")
            continue
        setattr(bar, name, value)
    bpy.context.view_layer.update()
    size = float(np.ptp(scenes.world_points(bar), axis=0).max())
    empty = scenes.cube_empty(bar.matrix_world.translation, (size, size, size))
    bpy.context.view_layer.update()
    scenes.activate(empty, bar)
    bpy.ops.arapfields.add_handle()
    scenes.activate(bar)
    before = scenes.world_points(bar)
    middle = Matrix.Translation(bar.matrix_world.translation)
    turn = middle @ Matrix.Rotation(math.radians(25), 4, "Z") @ middle.inverted()
    empty.matrix_world = turn @ empty.matrix_world
    bpy.ops.arapfields.deform(output="WARP", **scenes.NEW | {"iterations": 120})
    result = bpy.data.objects["Bar_deformed"]
    assert np.array_equal(np.array(result.matrix_world), np.array(bar.matrix_world))
    turn = np.array(turn)
    expected = before @ turn[:3, :3].T + turn[:3, 3]
    assert np.abs(scenes.world_points(result) - expected).max() < 0.03 * size


def test_a_second_run_updates_the_same_object():
    scenes.bar_with_handles()
    for _ in range(2):
        scenes.activate(bpy.data.objects["Bar"])
        bpy.ops.arapfields.deform(output="WARP", **scenes.NEW)
    assert [o.name for o in bpy.data.objects if "deformed" in o.name] == ["Bar_deformed"]
    assert len([m for m in bpy.data.meshes if "deformed" in m.name]) == 1


def test_same_seed_same_result():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.4
    reports = []
    for _ in range(2):
        scenes.activate(bar)
        bpy.ops.arapfields.deform(output="WARP", **scenes.NEW)
        reports.append(scenes.world_points(bpy.data.objects["Bar_deformed"]))
    assert np.array_equal(*reports)


def test_a_script_names_the_object_by_an_override_of_the_context():
    """As for Blender's own operators; whatever was active was deformed."""
    bar, _, moving = scenes.bar_with_handles()
    other, _, others_moving = scenes.bar_with_handles("Other")
    moving.location.z += 0.4
    others_moving.location.z += 0.4
    with bpy.context.temp_override(active_object=bar, selected_objects=[bar]):
        assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert bar.modifiers and not other.modifiers and bpy.context.view_layer.objects.active == other
    scene = bpy.data.scenes.new("Second")
    scene.collection.objects.link(other)
    scene.view_layers[0].objects.active = other
    scenes.activate(bar)
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert other.modifiers


def test_several_objects_in_one_call_and_one_that_fails():
    bars = [scenes.bar_with_handles(name)[0] for name in ("One", "Two")]
    bare = scenes.bar("Bare")
    scenes.activate(bare, *bars)
    assert bpy.ops.arapfields.deform(scope="SELECTED", **scenes.NEW) == {"FINISHED"}
    assert {"One_deformed", "Two_deformed"} <= set(bpy.data.objects.keys())
    assert "Bare_deformed" not in bpy.data.objects
    assert [level for level, _ in jobs.messages()] == ["INFO", "INFO", "WARNING"]
    assert "Bare has no handle" in jobs.messages()[-1][1]


def test_the_line_about_a_result_says_what_it_has_reached_and_no_name_twice():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.3
    for result, begin in (("MODIFIER", "Bar: follows"), ("NEW", "Bar: Bar_deformed")):
        bar.arapfields.result = result
        bpy.ops.arapfields.deform(**scenes.QUICK)
        level, line = jobs.messages()[0]
        assert level == "INFO" and line.startswith(begin) and line.count("Bar:") == 1, line
        assert "follows its handles within" in line and "no folds" in line and "energy" not in line


@pytest.mark.parametrize("error, share", [(1e-9, "0.1%"), (0.0014, "0.1%"), (0.003, "0.2%"), (0.1, "5.0%")])
def test_what_is_said_of_the_handles_is_a_bound(error, share):
    line = solve_job.describe("", {"handle_error_max": error, "flipped_share": 0.0}, 2.0)
    assert line == f"follows its handles within {share}, no folds"
