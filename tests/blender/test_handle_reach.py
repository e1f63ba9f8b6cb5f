# SPDX-License-Identifier: GPL-3.0-or-later
"""What a handle's box holds and moves: its reach, its scale, subdivided cages, wraps, symmetry."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bmesh
    import bpy
    from support.blender import scenes
    from support.blender.baking import RUN, cache_file
    from support.blender.live import pin, step
    from support.blender.panels import drawn
    from support.blender.stacks import local_points
    from support.blender.wraps import SMALL

    from addon.blender.object_references import settings_of
    from addon.core.runtime import jobs
    from addon.handles import native_handles, symmetry
    from addon.handles.overlays import CIRCLE_ENDS, box_lines, ghosts, segments
    from addon.live import sessions
    from addon.pin_tool import drag, drawing
    from addon.pin_tool.operators import reach_steps

pytestmark = pytest.mark.in_blender

# Handles that reach so far only: beyond, nothing moves.

REACH = 0.6


def reaching_bar(scale=(1.0, 1.0, 1.0)):
    """(bar, handle, rest, which points are beyond): its end is pulled, by a handle that reaches 0.6."""
    bar, _, moving = scenes.bar_with_handles()
    bar.rotation_euler.z, bar.scale = 0.3, scale
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.reset_handle(all=True)
    bpy.context.view_layer.update()
    rest, entry = local_points(bar), bar.arapfields.handles[1]
    entry.reach = REACH
    moving.location.z += 0.3
    bpy.context.view_layer.update()
    return bar, entry, rest, rest[:, 0] < 0.7 - REACH  # nothing left of 0.75 is held


@pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (1.3, 0.8, 1.0)])
def test_beyond_its_reach_nothing_moves_to_the_last_bit(scale):
    bar, entry, rest, beyond = reaching_bar(scale)
    assert beyond.sum() > 100
    bpy.ops.arapfields.deform(**RUN)
    assert np.array_equal(local_points(bar)[beyond], rest[beyond])
    assert np.abs(local_points(bar) - rest).max() > 0.1
    bpy.ops.arapfields.live()
    step()
    assert np.array_equal(local_points(bar)[beyond], rest[beyond])
    assert np.abs(local_points(bar) - rest).max() > 0.1
    entry.reach = 0.0
    step()
    assert np.abs(local_points(bar)[beyond] - rest[beyond]).max() > 1e-3
    entry.reach = 0.3
    step()
    assert np.array_equal(local_points(bar)[rest[:, 0] < 0.4], rest[rest[:, 0] < 0.4])
    bpy.ops.arapfields.live()


def test_a_bake_heeds_the_reach():
    bar, entry, rest, beyond = reaching_bar()
    z = entry.empty.location.z
    for frame, height in ((1, z - 0.3), (3, z)):
        entry.empty.location.z = height
        entry.empty.keyframe_insert("location", frame=frame)
    bpy.ops.arapfields.bake(start=1, end=3, filepath=cache_file())
    for frame in (2, 3):
        bpy.context.scene.frame_set(frame)
        assert np.array_equal(local_points(bar)[beyond], rest[beyond])
        assert np.abs(local_points(bar) - rest).max() > 0.1


def test_what_cannot_heed_a_reach_says_so_and_a_style_acts_everywhere():
    bar, _, rest, beyond = reaching_bar()
    for options in ({"field": "neural"}, {"exact_handles": True}):
        with pytest.raises(RuntimeError, match="Moving has a reach; take the method Fast"):
            bpy.ops.arapfields.deform(**options)
    assert np.array_equal(local_points(bar), rest)
    bar.arapfields.stylize.use_handles = True
    assert bpy.ops.arapfields.stylize(samples=1500, iterations=15) == {"FINISHED"}
    assert np.abs(local_points(bar)[beyond] - rest[beyond]).max() > 1e-3
    scenes.activate(bar)


def test_the_wheel_changes_the_reach_in_a_drag_and_cancel_takes_it_back():
    bar = scenes.bar()
    rest = local_points(bar)
    empty = pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.5))
    (entry,) = bar.arapfields.handles
    assert entry.reach == 0.0 and not np.array_equal(local_points(bar)[rest[:, 0] < 0], rest[rest[:, 0] < 0])
    dragged = drag.of_entry(bpy.context, bar, entry)
    dragged.move(bpy.context, (1.0, 0.0, 0.6))
    dragged.change_reach(bpy.context, -1)
    size = float(np.linalg.norm(np.ptp(np.array(bar.bound_box), axis=0)))  # as shown
    assert abs(entry.reach - size) < 0.1 * size and entry.reach > 2
    dragged.change_reach(bpy.context, -10)
    step()
    dragged.end(bpy.context)
    assert 0.7 < entry.reach < 0.9
    beyond = rest[:, 0] < 1.0 - 0.15 - entry.reach - 0.01
    assert beyond.any() and np.array_equal(local_points(bar)[beyond], rest[beyond])
    before, kept = local_points(bar).tobytes(), entry.reach
    dragged = drag.of_entry(bpy.context, bar, entry)
    dragged.change_reach(bpy.context, 5)
    step()
    dragged.cancel(bpy.context)
    assert entry.reach == kept and local_points(bar).tobytes() == before
    dragged = drag.of_entry(bpy.context, bar, entry)
    dragged.change_reach(bpy.context, -100)
    assert 0.1 < entry.reach < 0.2  # the pin's own radius
    dragged.change_reach(bpy.context, 100)
    assert entry.reach == 0.0
    dragged.cancel(bpy.context)
    assert empty.name == "Pin 1"


def test_the_keys_are_those_of_proportional_editing():
    def event(type_, ctrl=False, value="PRESS"):
        return SimpleNamespace(type=type_, ctrl=ctrl, value=value)

    assert reach_steps(event("PAGE_UP")) == 1 and reach_steps(event("PAGE_DOWN")) == -1
    assert reach_steps(event("WHEELDOWNMOUSE", True)) == 1 and reach_steps(event("WHEELUPMOUSE", True)) == -1
    assert reach_steps(event("WHEELUPMOUSE")) == 0  # turns to zooming
    assert reach_steps(event("PAGE_UP", value="RELEASE")) == 0


def test_the_reach_is_drawn_about_a_selected_handle():
    bar = scenes.bar()
    bar.scale = (2, 2, 2)
    bpy.context.view_layer.update()
    empty = pin(bar, (2.0, 0.0, 0.5))
    (entry,) = bar.arapfields.handles
    assert segments(bar) == []
    entry.reach = 0.4
    ((_, _, ends),) = segments(bar)
    away = np.linalg.norm(np.array(ends) - np.array(empty.matrix_world.translation), axis=1)
    assert np.abs(away - (0.8 + 0.15)).max() < 1e-5  # in the world, from the pin's rim
    bar.arapfields.active_handle = -1
    assert segments(bar) == []


# Handles that scale what they hold, where that is asked for.


def enlarged(allow):
    """(bar, moving): the bar's end is half as large again, by its handle; held at the other."""
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.handles[1].allow_scale = allow
    moving.scale = [1.5 * s for s in moving.scale]
    bpy.context.view_layer.update()
    scenes.activate(bar)
    return bar, moving


@pytest.mark.parametrize("allow", [False, True])
def test_what_a_handle_holds_is_scaled_where_asked(allow):
    bar, moving = enlarged(allow)
    rest = np.array([v.co for v in bar.data.vertices])
    held = rest[:, 0] > 0.8
    expected = rest[held] + ([0.5, 0.5, 0.5] * (rest[held] - [1, 0, 0]) if allow else 0.0)
    bpy.ops.arapfields.deform(**RUN)
    shapes = [local_points(bar)]
    bpy.ops.arapfields.live()
    step(refined=True)
    shapes.append(local_points(bar))
    bpy.ops.arapfields.live()
    moving.keyframe_insert("scale", frame=1)
    bpy.ops.arapfields.bake(start=1, end=1, filepath=cache_file())
    shapes.append(local_points(bar))
    for after in shapes:
        error = np.abs(after[held] - expected).max()
        print(allow, error)
        assert error < (0.03 if allow else 0.01)  # handles are followed nearly
        assert np.abs(after[rest[:, 0] < -0.8] - rest[rest[:, 0] < -0.8]).max() < 0.03


def test_a_flat_or_mirrored_scale_is_refused_by_name_and_by_axis_it_may_differ():
    bar, moving = enlarged(True)
    kept = moving.scale[2]
    for bad in (0.0, -kept):
        moving.scale[2] = bad
        bpy.context.view_layer.update()
        with pytest.raises(RuntimeError, match="Moving: its scale flattens or mirrors"):
            bpy.ops.arapfields.deform(**RUN)
    moving.scale = (0.25, 0.5, 1.0)
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**RUN)
    tip = np.array([v.co.x for v in bar.data.vertices]) > 0.9
    after = local_points(bar)[tip]
    assert abs(np.ptp(after[:, 2]) - 1.0) < 0.1 and abs(np.ptp(after[:, 1]) - 0.5) < 0.1
    bpy.ops.arapfields.mirror_handle(axis="X")
    assert all(entry.allow_scale for entry in bar.arapfields.handles[1:])


def test_a_scale_that_counts_for_nothing_is_said():
    said = "Moving is scaled, which counts only with Allow Scale"

    def warnings():
        return said in " ".join(drawn()["ARAPFIELDS_PT_handles"])

    bar, moving = enlarged(False)
    assert warnings()
    assert bpy.ops.arapfields.deform(**RUN) == {"FINISHED"}
    assert any(level == "WARNING" and said in text for level, text in jobs.messages())
    bar.arapfields.handles[1].allow_scale = True
    assert not warnings()
    bar.arapfields.handles[1].allow_scale = False
    moving.scale = [s / 1.5 for s in moving.scale]
    moving.rotation_euler = (0.3, 0.2, 0.1)
    bpy.context.view_layer.update()
    assert not warnings()


# Boxes around what a Subdivision Surface shows, where the cage lies outside of them.

CORNER = 0.87  # about where three levels have the corner of a cube from -1 to 1 of 4 × 4 quads a side
FOLLOWS = 0.1  # of a motion: how far what a box around a corner holds stays behind


def edit(mesh, change):
    made = bmesh.new()
    made.from_mesh(mesh)
    change(made)
    made.to_mesh(mesh)
    made.free()


def subdivided_cube(levels=3):
    """A cube with boxes around two opposite corners as they are seen: (cube, _, moving)."""
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    cube = bpy.context.object
    edit(
        cube.data, lambda mesh: bmesh.ops.subdivide_edges(mesh, edges=mesh.edges, cuts=3, use_grid_fill=True)
    )
    cube.modifiers.new("Subdivision", "SUBSURF").levels = levels
    boxes = [scenes.cube_empty(side * CORNER * np.ones(3), (0.1,) * 3, str(side)) for side in (-1, 1)]
    bpy.context.view_layer.update()
    scenes.activate(*boxes, cube)
    assert bpy.ops.arapfields.add_handle() == {"FINISHED"}
    scenes.activate(cube)
    return cube, *boxes


@pytest.mark.parametrize("way", ["deform", "live"])
def test_a_box_holds_what_is_seen_in_it(way):
    cube, _, moving = subdivided_cube()
    assert all(entry.inside > 8 for entry in cube.arapfields.handles)
    rest = scenes.world_points(cube)
    moving.location.x += 0.3
    cube.arapfields.deform.locality = 0.0  # by which what is beside a corner of so coarse a cage rests
    if way == "deform":
        assert bpy.ops.arapfields.deform(field="radial", samples=2000) == {"FINISHED"}
    else:
        assert bpy.ops.arapfields.live() == {"FINISHED"}
        step(refined=True)
    shift = scenes.world_points(cube) - rest
    near = [np.abs(rest - side * CORNER).max(axis=1) < 0.08 for side in (-1, 1)]
    assert np.abs(shift[near[0]]).max() < FOLLOWS * 0.3
    assert np.abs(shift[near[1]] - [0.3, 0, 0]).max() < FOLLOWS * 0.3


def test_a_box_that_holds_some_of_the_cage_holds_that_alone():
    cube, _, moving = subdivided_cube()
    moving.location, moving.scale = (1, 1, 1), (0.2, 0.2, 0.2)
    bpy.context.view_layer.update()
    bpy.ops.arapfields.set_rest(all=True)
    with_it = [entry.inside for entry in cube.arapfields.handles]
    cube.modifiers["Subdivision"].show_viewport = False
    with pytest.raises(RuntimeError, match="No part of the surface"):
        bpy.ops.arapfields.set_rest(all=True) and bpy.ops.arapfields.deform(samples=500)
    assert cube.arapfields.handles[1].inside == with_it[1] > 0 and cube.arapfields.handles[0].inside == 0


def test_a_box_beside_what_is_seen_still_holds_nothing():
    cube, _, moving = subdivided_cube()
    moving.location = (3, 3, 3)
    bpy.context.view_layer.update()
    bpy.ops.arapfields.set_rest(all=True)
    assert cube.arapfields.handles[1].inside == 0
    with pytest.raises(RuntimeError, match="No part of the surface lies in the rest region of 1"):
        bpy.ops.arapfields.deform(samples=500)


def test_large_cages_are_subdivided_less():
    cube, *_ = subdivided_cube(levels=6)
    places, seen = native_handles.read_subdivided(bpy.context, cube, True, [])
    assert len(places) == len(seen) < native_handles.MOST
    assert np.abs(np.abs(places).max(axis=1) - 1.0).max() < 1e-6  # on the cage
    assert np.abs(seen - places).max() > 0.1 and len(bpy.data.scenes) == 1
    assert cube.modifiers["Subdivision"].levels == 6


# Handles that were made before a wrap go with the surface that they hold.

SIDES = 1e-3  # of the bar's length: matrices in single precision
SAME = 1e-5  # the same, of those that were stored


def handled_bar(**place):
    """(bar, fixed, moving, target): its handles lie elsewhere than the target."""
    bar, fixed, moving = scenes.bar_with_handles()
    target = scenes.bar("Scan")
    target.location, target.rotation_euler, target.scale = (3, 1, 0.5), (0, 0, 0.5), (1.5, 1.8, 1.4)
    bar.arapfields.wrap.onto = target
    for name, value in place.items():
        setattr(bar, name, value)
    scenes.activate(bar)
    bpy.context.view_layer.update()
    return bar, fixed, moving, target


def held(bar):
    return [entry.inside for entry in settings_of(bar).handles]


@pytest.mark.parametrize("rigid", [True, False])
def test_boxes_go_with_what_they_hold(rigid):
    bar, fixed, moving, _ = handled_bar(**({} if rigid else {"scale": (1.0, 1.3, 0.8)}))
    rest, counts = scenes.world_points(bar), held(bar)
    for count in range(2):  # once more as well
        assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
        shown = scenes.world_points(bar)
        for empty, side in ((fixed, -1), (moving, 1)):
            ends = np.abs(rest[:, 0] - side) < 0.25
            local = (shown - np.array(empty.matrix_world.translation)) @ np.linalg.inv(
                np.array(empty.matrix_world)[:3, :3]
            ).T
            inside = (np.abs(local) <= 1 + SIDES).all(axis=1)
            assert inside[ends].all() and inside.sum() < 1.5 * ends.sum(), (count, side)
        assert min(held(bar)) > 0.5 * min(counts)
    before = scenes.world_points(bar)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert np.abs(scenes.world_points(bar) - before).max() < 0.01  # all are at rest
    bpy.ops.arapfields.remove_field()
    bpy.ops.arapfields.remove_field()
    assert np.array_equal(scenes.world_points(bar), rest)
    for empty, side in ((fixed, -1), (moving, 1)):
        assert np.abs(np.array(empty.matrix_world.translation) - [side, 0, 0]).max() < SAME
        assert np.abs(np.array(empty.scale) - [0.25, 0.5, 0.5]).max() < SAME
    assert held(bar) == counts


def test_a_handle_that_was_moved_keeps_its_motion():
    bar, _, moving, _ = handled_bar()
    moving.location.z += 0.3
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    bpy.ops.arapfields.reset_handle(all=True)
    bpy.context.view_layer.update()
    assert min(held(bar)) > 0
    before = scenes.world_points(bar)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert np.abs(scenes.world_points(bar) - before).max() < 0.01


def test_one_that_is_animated_stays_and_is_named():
    bar, _, moving, _ = handled_bar()
    moving.keyframe_insert("location", frame=1)
    place = moving.matrix_world.copy()
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    assert moving.matrix_world == place and held(bar)[1] == 0 < held(bar)[0]
    assert any("Moving" in text for kind, text in jobs.messages() if kind == "WARNING"), jobs.messages()


def test_pins_go_along_and_keep_their_size():
    bar, *_ = handled_bar()
    bpy.ops.arapfields.pin_add(location=(1.0, 0.0, 0.25))
    pin = settings_of(bar).handles[-1].empty
    size, rest = pin.matrix_world.to_scale(), scenes.world_points(bar)
    nearest = np.abs(rest - [1.0, 0.0, 0.25]).sum(axis=1).argmin()
    scenes.activate(bar)
    assert bpy.ops.arapfields.wrap(**SMALL) == {"FINISHED"}
    away = np.array(pin.matrix_world.translation) - scenes.world_points(bar)[nearest]
    assert np.linalg.norm(away) < 0.1 and np.allclose(pin.matrix_world.to_scale(), size, rtol=1e-4)


def test_a_new_object_leaves_them_where_they_are():
    bar, fixed, *_ = handled_bar()
    place = fixed.matrix_world.copy()
    assert bpy.ops.arapfields.wrap(**SMALL, result="NEW") == {"FINISHED"}
    assert fixed.matrix_world == place and min(held(bar)) > 0


# With symmetry, handles and pins have ghosts on the other side.


def test_ghosts_are_where_the_other_side_is_held_and_goes():
    bar, fixed, moving = scenes.bar_with_handles()
    fixed.location, fixed.scale = (0, 0, 0), (0.1, 0.5, 0.5)
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.set_rest(all=True)
    assert ghosts(bar) == []
    bar.arapfields.deform.symmetry = "x"
    ((_, _, ends),) = ghosts(bar)  # none of the box on the plane
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    rest = np.array(moving.matrix_world)
    assert np.allclose(np.sort(ends, axis=0), np.sort(box_lines(mirror @ rest), axis=0), atol=1e-6)
    moving.location.z += 0.3
    bpy.context.view_layer.update()
    shapes = ghosts(bar)
    assert len(shapes) == 2 and len(segments(bar)) == 3
    now = np.array(shapes[1][2][:24])
    assert np.allclose(now.mean(axis=0), [-1, 0, 0.3], atol=1e-6)
    assert np.allclose(np.array(shapes[0][2]).mean(axis=0), [-1, 0, 0], atol=1e-6)
    bpy.ops.arapfields.live()
    step(refined=True)
    field = sessions.live[bar.session_uid].solver.field
    middle = np.array([[-1.0, 0.0, 0.0]])
    assert np.abs(field(middle) - now.mean(axis=0)).max() < 0.05  # what the ghost says is what happens
    bpy.ops.arapfields.live()


def test_pins_have_theirs_on_turned_and_scaled_objects_too():
    bar = scenes.bar()
    bar.location, bar.rotation_euler.z, bar.scale = (1, 2, 3), 0.7, (2, 2, 2)
    bpy.context.view_layer.update()
    world = np.array(bar.matrix_world)

    def at(*local):
        return (world @ [*local, 1.0])[:3]

    pin(bar, at(0.9, 0.0, 0.25), target=at(0.9, 0.0, 0.5))
    bar.arapfields.deform.symmetry = "x"
    handles = [(bar, entry) for entry in bar.arapfields.handles]
    ((_, _, spot),) = drawing.ghosts(handles)
    assert np.allclose(spot, at(-0.9, 0.0, 0.5), atol=1e-5)
    way, rest, now = (np.array(ends) for _, _, ends in ghosts(bar))
    assert np.allclose(way, [at(-0.9, 0.0, 0.25), at(-0.9, 0.0, 0.5)], atol=1e-5)
    assert len(rest) == len(now) == CIRCLE_ENDS
    assert np.allclose(rest.mean(axis=0), way[0], atol=1e-5)
    assert np.allclose(now.mean(axis=0), way[1], atol=1e-5)
    assert np.allclose(np.linalg.norm(now - way[1], axis=1), 0.15, atol=1e-5)
    bar.arapfields.deform.symmetry = "none"
    assert drawing.ghosts(handles) == [] and ghosts(bar) == []


# Symmetry with the origin beside the mesh, as after an import: across its own middle, which is said.

UP = np.array([0.0, 0.0, 0.4])
BESIDE = 3.0  # how far the bar's middle is from its origin, in its coordinates


def bar_beside_its_origin(scale=1.0):
    bar = scenes.bar()
    for vertex in bar.data.vertices:
        vertex.co.x += BESIDE
    bar.data.update()
    bar.location.x, bar.scale = 0.5, (scale, 1.0, 1.0)
    bpy.context.view_layer.update()
    return bar


def lifts(bar, rest):
    """How far the two ends have risen."""
    rise = (scenes.world_points(bar) - rest)[:, 2]
    ends = rest[:, 0] < rest[:, 0].min() + 0.1, rest[:, 0] > rest[:, 0].max() - 0.1
    return [float(rise[end].mean()) for end in ends]


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_drag_moves_both_sides(scale):
    bar = bar_beside_its_origin(scale)
    rest = scenes.world_points(bar)
    bar.arapfields.deform.symmetry = "x"
    right = np.array([rest[:, 0].max(), 0.0, 0.25])
    pin(bar, right, target=right + UP)
    step(refined=True)
    left, lifted = lifts(bar, rest)
    assert lifted > 0.2 and abs(left - lifted) < 0.02
    middle = (scenes.world_points(bar)[:, 0].min() + scenes.world_points(bar)[:, 0].max()) / 2
    assert abs(middle - (0.5 + scale * BESIDE)) < 0.02
    mirrored = symmetry.mirror_of(bar) @ [*right, 1.0]
    assert np.abs(mirrored[:3] - [rest[:, 0].min(), 0.0, 0.25]).max() < 0.01


def test_deform_does_the_same_and_says_so():
    bar = bar_beside_its_origin()
    rest = scenes.world_points(bar)
    right = np.array([rest[:, 0].max(), 0.0, 0.25])
    pin(bar, right, target=right + UP)
    sessions.end(bpy.context, bar)
    bar.arapfields.deform.symmetry = "x"
    jobs.board.messages.clear()
    bpy.ops.arapfields.deform(samples=1000)
    left, lifted = lifts(bar, rest)
    assert lifted > 0.2 and abs(left - lifted) < 0.02
    assert any("across the middle of Bar" in text for _, text in jobs.messages())


def test_a_switch_of_symmetry_while_live_takes_the_plane_in():
    bar = bar_beside_its_origin()
    rest = scenes.world_points(bar)
    right = np.array([rest[:, 0].max(), 0.0, 0.25])
    pin(bar, right, target=right + UP)
    left, lifted = lifts(bar, rest)
    assert abs(left - lifted) > 0.2
    bar.arapfields.deform.symmetry = "x"
    step(refined=True)
    step(refined=True)
    left, lifted = lifts(bar, rest)
    assert abs(left - lifted) < 0.02


def test_the_origins_plane_counts_where_it_is_one_or_none_is():
    bar = scenes.bar()
    assert symmetry.offset_of(bar, "x") == symmetry.offset_of(bar, "z") == 0.0
    assert symmetry.beside(bar, "x") is None
    for vertex in bar.data.vertices:  # a wedge that leans: across no plane x = c
        vertex.co.x += BESIDE + 2.0 * vertex.co.z
    bar.data.update()
    assert symmetry.offset_of(bar, "x") == 0.0
    assert abs(symmetry.offset_of(bar_beside_its_origin(), "x") - BESIDE) < 0.01
