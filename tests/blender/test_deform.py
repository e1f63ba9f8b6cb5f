# SPDX-License-Identifier: GPL-3.0-or-later
"""Deform, its first result, and points or scales that other modifiers and actions move."""

import math
import tempfile
import types

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.baking import animated, at, saved_animation
    from support.blender.live import pin, step
    from support.blender.stacks import add_modifier, local_points
    from support.blender.wraps import rigged_bar, rigged_character

    from addon import lifecycle
    from addon.blender import host, modifier_stack
    from addon.core.geometry.spaces import space_of, unflattened
    from addon.core.runtime import jobs, threads
    from addon.deform import solve_job
    from addon.deform.solve_job import FirstResult, steps
    from addon.field_modifier import motion
    from addon.live import sessions
    from addon.names import OFFSETS
    from addon.solver import frame_solver
    from addon.surface.source_surface import PointsBefore, read_surface

pytestmark = pytest.mark.in_blender

# Deforming inside Blender: what moves, what stays, in whichever space the object lives.


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


@pytest.mark.parametrize("height", [0.25, 0.37])
def test_a_pose_that_is_finished_is_the_one_that_was_shown(height):
    """A raised hand drew the whole body up to it."""
    body, _ = rigged_character()
    scenes.activate(body)
    rest = scenes.world_points(body)
    size, hand = np.ptp(rest, axis=0).max(), rest[rest[:, 0].argmax()]
    pin(body, hand, 0.05 * size, target=hand + size * np.array((-0.15, 0, height)))
    step(refined=True)
    live = scenes.world_points(body)
    assert np.linalg.norm(live - rest, axis=1).mean() < 0.03 * size
    assert bpy.ops.arapfields.deform() == {"FINISHED"}
    assert not sessions.live and body.arapfields.moved_by == "DEFORM"
    away = np.linalg.norm(scenes.world_points(body) - live, axis=1) / size
    assert away.mean() < 0.003 and away.max() < 0.03
    assert "keeps its live pose" in str(jobs.messages())
    bpy.ops.arapfields.deform()  # anew, with nothing live to keep
    assert "keeps its live pose" not in str(jobs.messages())


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


# What a running solve shows on the source itself: nothing of it stays, in no step of undo either.


def test_what_is_shown_is_put_back_bit_for_bit():
    bar, *_ = scenes.bar_with_handles()
    for earlier in (False, True):
        if earlier:
            assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
        before = state(bar)
        first, moved = first_result(bar)
        for share in (0.5, 1.0):
            first.show((first.points + share * (moved - first.points)).astype(np.float32))
        shown = scenes.world_points(bar)
        expected = first._surface.space.solve_to_world
        expected = moved @ expected[:3, :3].T + expected[:3, 3]
        assert np.abs(shown - expected).max() < 1e-5  # single precision
        first.clear()
        assert state(bar) == before
        first.clear()
        assert state(bar) == before


def test_the_field_keeps_the_place_below_the_armature_that_a_wrap_took_for_it():
    item, _ = rigged_bar()
    item.arapfields.under_rig = True
    place = modifier_stack.place(item)
    first, moved = first_result(item)
    first.show(moved.astype("f4"))
    assert [m.type for m in item.modifiers] == ["NODES", "ARMATURE"]
    first.clear()
    assert [m.type for m in item.modifiers] == ["ARMATURE"]
    assert modifier_stack.place(item) == place == 0


def test_steps_that_were_pushed_meanwhile_hold_nothing_of_it():
    bpy.context.preferences.edit.use_global_undo = True
    for earlier in (False, True):
        bar, *_ = scenes.bar_with_handles(f"Bar {earlier}")
        name = bar.name
        if earlier:
            assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="before")
        before = state(bar)
        first, moved = first_result(bar)
        first.show(moved.astype("f4"))
        assert state(bar) != before
        bpy.ops.ed.undo_push(message="between")
        first.clear()
        assert state(bar) == before
        bpy.ops.ed.undo_push(message="after")
        for step in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo, bpy.ops.ed.undo):
            step()
            assert state(bpy.data.objects[name]) == before


def test_an_undone_step_takes_the_helper_of_a_shared_mesh_away():
    """The object behind its source in Blender's list, whose memory the next look at that would read."""
    bar = scenes.bar()
    bpy.data.objects.new("Twin", bar.data)
    motion.bind(bpy.context, bar)
    steps.note(bar, motion.snapshot(bar), None)
    lifecycle.after_restore()
    steps.clear()
    assert [item.name for item in bpy.data.objects] == ["Bar", "Twin"]


def test_a_first_result_waits_for_the_end_of_edit_mode():
    bar, *_ = scenes.bar_with_handles()
    before = state(bar)
    first, moved = first_result(bar)
    first.show(moved.astype("f4"))
    bpy.ops.object.mode_set(mode="EDIT")
    first.show(first.points.astype("f4"))
    first.clear()
    (waiting,) = [function for function in host.running() if function.__name__ == "attempt"]
    assert waiting() > 0
    bpy.ops.object.mode_set(mode="OBJECT")
    assert waiting() is None
    host.clear()
    assert state(bar) == before


def test_a_mesh_that_changed_is_left_alone():
    bar, *_ = scenes.bar_with_handles()
    first, moved = first_result(bar)
    bar.data = bar.data.copy()
    bar.data.clear_geometry()
    first.show(moved.astype("f4"))
    assert not bar.modifiers and OFFSETS not in bar.data.attributes
    bpy.data.objects.remove(bar)
    first.show(moved.astype("f4"))
    first.clear()


def test_no_thread_works_on_when_the_process_ends():
    bar, *_ = scenes.bar_with_handles()
    sessions.begin(bpy.context, bar)
    assert threads.own_threads()
    lifecycle.end_threads()
    assert not threads.own_threads()
    sessions.live.clear()


def first_result(bar):
    """What shows a solve of this object, and (n, 3) moved points in solve space."""
    first = FirstResult(read_surface(bpy.context, bar, in_place=True))
    moved = first.points.copy()
    moved[:, 2] += 0.2 * moved[:, 0] ** 2
    return first, moved


def state(bar):
    """All that a first result touches, comparable bit for bit."""
    bpy.context.view_layer.update()
    names = [sorted(getattr(bpy.data, kind).keys()) for kind in ("objects", "meshes", "node_groups")]
    attributes = [(a.name, a.domain, a.data_type) for a in bar.data.attributes]
    stack = [(m.name, m.type, m.show_viewport) for m in bar.modifiers]
    return names, sorted(attributes), stack, scenes.world_points(bar).tobytes()


# Where modifiers before the field move the points off the surface at rest: live, bakes and Deform agree.

AGREE = 0.02  # 1 % of the bar's length: solves of other samples and other steps
EXACT = 1e-12


def posed(path, last):
    """The bar whose right end rises, on two bones of which one is keyed; at another frame than the pins'."""
    bar, scene = saved_animation()[0], bpy.context.scene
    add_modifier(bar, "ARMATURE")
    bones = bar.modifiers["Armature"].object.pose.bones
    bone = bones["Second" if path == "rotation_euler" else "Bone"]
    bones["Second"].rotation_euler.z = 0.0
    for frame, value in ((1, (0.0, 0.0, 0.0)), (5, last)):
        setattr(bone, path, value)
        bone.keyframe_insert(path, frame=frame)
    scene.frame_set(4)
    scenes.activate(bar)
    return bar


def live_points(bar, samples):
    """What live mode shows with so many samples."""
    few, frame_solver.SAMPLES = frame_solver.SAMPLES, samples
    try:
        sessions.begin(bpy.context, bar)
        step(refined=True)
    finally:
        frame_solver.SAMPLES = few
    points = local_points(bar)
    sessions.end(bpy.context, bar)
    scenes.activate(bar)
    return points


def stretch(bar, points, before):
    """(least, most) length of an edge as a share of that before."""
    ends = np.array([edge.vertices[:] for edge in bar.data.edges])
    lengths = [np.linalg.norm(p[ends[:, 0]] - p[ends[:, 1]], axis=1) for p in (points, before)]
    shares = lengths[0] / lengths[1]
    return shares.min(), shares.max()


@pytest.mark.parametrize("pose", [("rotation_euler", (0.0, 0.0, 1.0)), ("location", (0.0, 5.0, 0.0))])
def test_live_bakes_and_deform_agree_beside_an_animated_pose(pose):
    """And none tears the shape, however many samples it takes, and however far the pose leads."""
    bar = posed(*pose)
    before = local_points(bar)
    shapes = [live_points(bar, samples) for samples in (500, 3000)]
    assert bpy.ops.arapfields.deform(field="radial", samples=4000) == {"FINISHED"}
    shapes.append(local_points(bar))
    assert bpy.ops.arapfields.bake(format="PC2", start=1, end=5) == {"FINISHED"}
    shapes.append(at(bar, 4))
    for shape in shapes:
        least, most = stretch(bar, shape, before)
        assert least > 0.8 and most < 1.25
        assert np.abs(shape - shapes[-1]).max() < AGREE
    assert np.abs(shapes[0] - before).max() > 0.3  # the handle has moved it


def test_clothes_stay_beside_a_posed_body():
    """They are posed by the same armature, and carried; live, in a job and in a bake."""
    bar = posed("rotation_euler", (0.0, 0.0, 1.0))
    bpy.context.scene.frame_set(1)
    coat = bar.copy()
    coat.data, coat.name = bar.data.copy(), "Coat"
    coat.arapfields.handles.clear()
    bpy.context.collection.objects.link(coat)
    scenes.set_positions(coat.data, local_points(bar) * (1.02, 1.1, 1.1))
    scenes.activate(coat, bar)
    assert bpy.ops.arapfields.carry(way="FOLLOW") == {"FINISHED"}
    bpy.context.scene.frame_set(4)
    rest = np.linalg.norm(scenes.world_points(coat) - scenes.world_points(bar), axis=1)
    sessions.begin(bpy.context, bar)
    step(refined=True)
    gaps = [scenes.world_points(coat) - scenes.world_points(bar)]
    sessions.end(bpy.context, bar)
    scenes.activate(bar)
    assert bpy.ops.arapfields.deform(field="radial", samples=4000) == {"FINISHED"}
    gaps.append(scenes.world_points(coat) - scenes.world_points(bar))
    for gap in gaps:
        assert np.abs(np.linalg.norm(gap, axis=1) - rest).max() < 0.02


def test_points_turn_with_the_field_at_their_rest():
    rng = np.random.default_rng(3)
    rest, q = rng.normal(size=(50, 3)), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    q *= np.sign(np.linalg.det(q))
    surface = types.SimpleNamespace(local=rest, vertices=rest, space=space_of(np.eye(4), "It"))
    field = types.SimpleNamespace(jacobian=lambda points: np.broadcast_to(q, (len(points), 3, 3)))
    moved = rest + np.where(np.arange(50)[:, None] < 20, rng.normal(size=(50, 3)), 0.0)
    assert np.abs(PointsBefore(surface, moved).moved(rest @ q.T, field) - moved @ q.T).max() < EXACT
    far = rest + np.array([0.0, 30.0, 0.0])
    assert np.abs(PointsBefore(surface, far).moved(rest @ q.T, field) - rest @ q.T - far + rest).max() < 1e-9
    assert PointsBefore(surface, rest.copy()).moved(moved, None) is moved


# Objects whose scale is animated: what squashes and stretches, grows from nothing, or vanishes.

SINGLE = 1e-6  # Blender keeps coordinates in single precision
HELD = 0.02  # how near a soft handle is met


def scaled(item, scales):
    """Keys the scale of an object: {frame: scale}."""
    for frame, scale in scales.items():
        item.scale = scale
        item.keyframe_insert("scale", frame=frame)


def bar_of_five_frames():
    """A bar whose right end rises from frame 1 to frame 5, and whose handles go along with it."""
    frame_solver.SAMPLES = 500
    bar = animated()
    for entry in bar.arapfields.handles:
        entry.empty.parent = bar
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 5
    return bar


def played(bar):
    """{frame: local points} of a live bar; it is off again then."""
    bpy.context.scene.frame_set(1)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    shapes = {}
    for frame in range(1, 6):
        bpy.context.scene.frame_set(frame)
        step(refined=True)
        assert sessions.is_live(bar)
        shapes[frame] = at(bar, frame)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    return shapes


def baked(bar):
    bpy.context.scene.frame_set(1)
    scenes.activate(bar)
    path = tempfile.mktemp(suffix=".pc2")
    assert bpy.ops.arapfields.bake(start=1, end=5, format="PC2", filepath=path) == {"FINISHED"}
    return {frame: at(bar, frame) for frame in range(1, 6)}


def test_what_squashes_and_stretches_is_posed_as_at_first_and_scaled_as_a_whole():
    bar = bar_of_five_frames()
    plain = played(bar)
    scaled(bar, {1: (1, 1, 1), 3: (1.4, 1.4, 0.5), 5: (1, 1, 1)})
    squashed = played(bar)
    for frame, shape in baked(bar).items():
        assert np.abs(squashed[frame] - plain[frame]).max() < HELD
        assert np.abs(squashed[frame] - shape).max() < SINGLE


def test_a_handle_that_stays_in_the_world_is_met_where_it_is():
    bar = bar_of_five_frames()
    moving = bpy.data.objects["Moving"]
    moving.parent = None
    scaled(bar, {1: (1, 1, 1), 5: (1.2, 1.2, 0.7)})
    bpy.context.scene.frame_set(1)
    held = np.flatnonzero(scenes.world_points(bar)[:, 0] > 0.8)
    played(bar)
    shape = baked(bar)[5]
    world = shape[held].mean(axis=0) @ np.array(bar.matrix_world)[:3, :3].T
    assert np.abs(world - np.array(moving.matrix_world.translation)).max() < HELD


@pytest.mark.parametrize("of", ["itself", "parent", "one axis", "hat", "whole hat"])
def test_what_grows_from_nothing_and_vanishes_is_played_and_baked(of):
    bar = bar_of_five_frames()
    plain = played(bar)
    nothing, full = (1, 1, 0) if of == "one axis" else (0, 0, 0), (1, 1, 1)
    growing = bar
    if of == "parent":
        growing = scenes.cube_empty((0, 0, 0), full, "Parent")
        bar.parent = growing
    elif "hat" in of:
        growing = scenes.bar("Hat", 0.2)
        growing.location = (1, 0, 0.5)
        scenes.activate(growing, bar)
        bpy.ops.arapfields.carry()
        bar.arapfields.carried[0].way = "RIGID" if of == "whole hat" else "FOLLOW"
    scaled(growing, {1: nothing, 2: full, 4: full, 5: nothing})
    shapes, shown = played(bar), baked(bar)
    for frame in range(1, 6):
        assert np.abs(shapes[frame] - shown[frame]).max() < SINGLE
    for frame in (2, 3, 4):
        assert np.abs(shapes[frame] - plain[frame]).max() < HELD


@pytest.mark.parametrize("scale", [(0, 0, 0), (2, 0, 3), (0, 0, -2), (1, 2, 3)])
def test_a_matrix_that_flattens_gets_a_volume(scale):
    turn = Matrix.Rotation(0.7, 4, (1, 2, 3))
    matrix = np.array(Matrix.Translation((1, 2, 3)) @ turn @ Matrix.LocRotScale(None, None, scale))
    full = unflattened(matrix)
    scales = np.linalg.norm(full[:3, :3], axis=0)
    assert np.allclose(full[:3, 3], matrix[:3, 3]) and np.linalg.det(full[:3, :3]) > 0.5
    for axis, given in enumerate(scale):
        assert np.isclose(scales[axis], abs(given) or max(map(abs, scale)) or 1.0)
        assert not given or np.allclose(full[:3, axis], matrix[:3, axis])
