# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact with obstacles, the ground and the mesh itself."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import at, cache_file, solved
    from support.blender.live import lowest, pressed, step
    from support.blender.panels import Layout
    from support.blender.stacks import local_points

    from addon.core.geometry.spaces import space_of
    from addon.core.runtime import jobs
    from addon.live import recovery, sessions
    from addon.pin_tool.tool import ARAPFIELDS_TOOL_pin
    from addon.solver import contact

pytestmark = pytest.mark.in_blender

# Contact in Blender: shapes stay outside of what is in the way, and refusals have sentences.


def test_a_live_shape_stays_outside_as_its_obstacle_comes_and_goes():
    bar, block, low = pressed()
    size = max(bar.dimensions)
    assert bpy.ops.arapfields.live(kind="DEFORM") == {"FINISHED"}
    free = lowest(bar)
    bar.arapfields.contact.use = bar.arapfields.contact.use_ground = bar.arapfields.contact.itself = True
    bar.arapfields.contact.ground = low - 0.2
    bpy.context.view_layer.update()
    held = lowest(bar)
    assert held > low - 0.2 - 2e-3 * size > free, (free, held, low, size)
    tinted = recovery.touching_points()
    assert len(tinted) > 3 and abs(tinted[:, 2] - low + 0.2).max() < 0.02 * size
    bar.arapfields.contact.use = False
    bpy.context.view_layer.update()
    assert abs(lowest(bar) - free) < 1e-3 * size and not len(recovery.touching_points())
    bpy.ops.arapfields.live(kind="DEFORM")
    bar.arapfields.contact.use, bar.arapfields.contact.use_ground = True, False
    scenes.activate(block, bar)
    bpy.ops.arapfields.add_obstacle()
    bpy.ops.arapfields.deform(samples=3000)
    assert "Bar: Moving is held back by Cube" in [text for _, text in jobs.messages()]
    sdf_top = low - 0.2
    inside = local_points(bar)
    world = inside @ np.array(bar.matrix_world)[:3, :3].T + np.array(bar.matrix_world)[:3, 3]
    over = (np.abs(world[:, :2] - np.array(block.location)[:2]) < 0.48).all(axis=1)
    assert over.any() and world[over, 2].min() > sdf_top - 2e-3 * size
    block.location, block.scale = bar.location, (0.05, 3, 3)
    bpy.ops.arapfields.deform(samples=1000)
    crosses = "Bar: Cube crosses the surface; what lies inside of it stays there"
    assert crosses in [text for _, text in jobs.messages()]


@pytest.mark.parametrize("rests", [False, True])
def test_a_cancelled_move_of_an_obstacle_ends_in_the_shape_before(rests):
    """Esc puts what was moved back: the shape before it is there at once, bit for bit, however long the move
    has rested elsewhere."""
    bar, block, _ = pressed()
    scenes.activate(block, bar)
    bpy.ops.arapfields.add_obstacle()
    bar.arapfields.contact.use = True
    assert bpy.ops.arapfields.live(kind="DEFORM") == {"FINISHED"}
    lowest(bar)
    before, height = local_points(bar), block.location.z
    for lift in (0.1, 0.3):
        block.location.z = height + lift
        step(refined=rests)
    assert np.abs(local_points(bar) - before).max() > 0.05
    block.location.z = height
    bpy.context.view_layer.update()
    sessions.update(bpy.context)  # without waiting
    assert np.array_equal(local_points(bar), before)
    step(refined=True)
    assert np.array_equal(local_points(bar), before)


def test_what_cannot_be_an_obstacle_is_said():
    bar, block, _ = pressed()
    group = bar.arapfields.contact
    assert contact.refusal(bar) is None
    group.use = True
    assert "neither" in str(contact.refusal(bar))
    group.itself = True
    assert (
        contact.refusal(bar) is None
        and contact.for_job(bpy.context, bar, True, space_of(bar.matrix_world)).made().itself
    )
    group.itself = False
    bpy.ops.arapfields.add_obstacle()  # nothing else is selected
    entry = group.obstacle_list[0]
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    bpy.context.collection.objects.link(lamp)
    empty = bpy.data.objects.new("Empty", bpy.data.meshes.new("Empty"))
    bpy.context.collection.objects.link(empty)
    bpy.context.view_layer.update()
    for item, said in ((bar, "its own"), (lamp, "no mesh")):
        entry.item = item
        assert said in str(contact.entry_refusal(bar, entry)) and said in str(contact.refusal(bar))
    entry.item, entry.name = block, block.name
    assert contact.refusal(bar) is None
    block.hide_set(True)
    assert "hidden" in str(contact.refusal(bar)) and not contact.obstacles_of(bar)
    block.hide_set(False)
    bar.arapfields.carried.add().item = block
    assert "carried" in str(contact.refusal(bar))
    bar.arapfields.carried.clear()
    scenes.activate(lamp, bar)
    with pytest.raises(RuntimeError, match="Lamp is no mesh; a mesh object is needed"):
        bpy.ops.arapfields.add_obstacle()
    block.name = "Renamed"
    assert contact.obstacles_of(bar) == [(block, 0.0)]
    bpy.data.objects.remove(block)
    assert "Cube is in no scene" in str(contact.refusal(bar))
    with pytest.raises(RuntimeError, match="in no scene"):
        bpy.ops.arapfields.deform()
    entry.item = empty
    with pytest.raises(RuntimeError, match="Empty: the mesh is empty"):
        bpy.ops.arapfields.deform()
    assert bpy.ops.arapfields.remove_obstacle() == {"FINISHED"} and not group.obstacle_list
    assert not bpy.ops.arapfields.remove_obstacle.poll()


def test_a_method_that_heeds_no_contact_is_refused_by_name():
    bar, _, _ = pressed()
    bar.arapfields.contact.use = bar.arapfields.contact.itself = True
    refused = pytest.raises(RuntimeError, match=f"{bar.name}: Contact needs the method Fast")
    for options in ({"field": "neural"}, {"field": "invertible"}, {"exact_handles": True}):
        with refused:
            bpy.ops.arapfields.deform(**options)
    with refused:
        bpy.ops.arapfields.stylize(field="neural")


def solids(bar):
    return contact.for_job(bpy.context, bar, True, space_of(bar.matrix_world)).solids


def test_obstacles_are_read_as_they_are_shown():
    """With modifiers, scales, mirrors, and a collection's visible meshes; what moves stays the same solid."""
    bar, block, _ = pressed()
    scenes.activate(block, bar)
    bpy.ops.arapfields.add_obstacle()
    bpy.ops.arapfields.add_obstacle()
    group = bar.arapfields.contact
    assert group.use and [entry.item for entry in group.obstacle_list] == [block]
    group.obstacle_list[0].margin = 0.125
    bar.location, bar.scale = (1, 2, 3), (2, 2, 2)
    known, keys, functions = {}, set(), []
    for scale, turn in (((1, 2, 3), 0.0), ((1, 2, 3), 1.0), ((-1, 2, 3), 0.4)):
        block.scale, block.rotation_euler = scale, (0.3, turn, 0.2)
        bpy.context.view_layer.update()
        (solid,) = solids(bar)
        linear = solid.placement[:3, :3]
        assert np.allclose(linear @ linear.T, np.cbrt(6) ** 2 * np.eye(3) / 4, atol=1e-4)
        assert np.linalg.det(linear) > 0 and solid.margin == pytest.approx(0.0625)
        world = np.array(bar.matrix_world) @ solid.placement
        seen = solid.vertices @ world[:3, :3].T + world[:3, 3]
        assert np.allclose(seen, scenes.world_points(block), atol=1e-4)
        a, b, c = (solid.vertices[solid.triangles[:, k]] for k in range(3))
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0  # the triangles face outwards
        contact.for_job(bpy.context, bar, True, space_of(bar.matrix_world)).made(known)
        keys.add(solid.key)
        functions += known.values()
    assert functions[0] is functions[1] and len(keys) == 2
    block.modifiers.new("Bevel", "BEVEL").width = 0.1
    bpy.context.view_layer.update()
    assert len(solids(bar)[0].vertices) > 8
    together = bpy.data.collections.new("Room")
    bpy.context.scene.collection.children.link(together)
    for item in (bpy.data.objects.new(name, block.data) for name in "ab"):
        together.objects.link(item)
    together.objects["b"].hide_viewport = True
    together.objects.link(bar)
    entry = group.obstacle_list.add()
    entry.group, entry.margin = together, 0.5
    bpy.context.view_layer.update()
    assert [(item.name, margin) for item, margin in contact.obstacles_of(bar)] == [
        (block.name, 0.125),
        (together.objects["a"].name, 0.5),
    ]
    block.scale = (0, 0, 0)
    bpy.context.view_layer.update()
    assert len(solids(bar)) == 1
    bpy.ops.ed.undo_push()
    bpy.ops.arapfields.remove_obstacle()
    bpy.ops.ed.undo_push()
    bpy.ops.ed.undo()
    assert len(bpy.data.objects["Bar"].arapfields.contact.obstacle_list) == 2


def test_an_obstacle_linked_from_another_file_is_one_as_any():
    bar, block, _ = pressed()
    block.scale, block.rotation_euler = (1, 2, 3), (0.3, 1.0, 0.2)
    scenes.activate(block, bar)
    bpy.ops.arapfields.add_obstacle()
    (wanted,) = solids(bar)
    bpy.ops.arapfields.remove_obstacle()
    (linked,) = scenes.from_another_file(block)
    assert linked.library is not None
    scenes.activate(linked, bar)
    bpy.ops.arapfields.add_obstacle()
    assert contact.refusal(bar) is None
    (solid,) = solids(bar)
    assert solid.key == wanted.key and np.allclose(solid.placement, wanted.placement, atol=1e-6)
    bpy.data.libraries.remove(linked.library)
    assert f"{bar.arapfields.contact.obstacle_list[0].name} is in no scene" in str(contact.refusal(bar))


def test_an_animated_obstacle_is_the_same_in_playback_bake_and_render():
    bar, block, _ = pressed()
    bpy.data.objects["Moving"].location.z += 0.8
    scenes.activate(block, bar)
    bpy.ops.arapfields.add_obstacle()
    for frame, rise in ((1, 0.0), (3, 0.4)):
        block.location.z += rise
        block.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)
    wanted = [solved(bar, frame) for frame in (1, 2, 3)]
    assert abs(wanted[2] - wanted[0]).max() > 0.02
    path = cache_file()
    assert bpy.ops.arapfields.bake(start=1, end=3, filepath=path) == {"FINISHED"}
    for frame, shape in zip((1, 2, 3), wanted, strict=True):
        assert abs(at(bar, frame) - shape).max() < 1e-6
    bpy.ops.arapfields.remove_bake()
    assert bpy.ops.arapfields.live(kind="DEFORM") == {"FINISHED"}
    for frame in (3, 1, 2):
        bpy.context.scene.frame_set(frame)
        step(refined=True)
        assert abs(local_points(bar) - wanted[frame - 1]).max() < 1e-6
    scenes.camera(8)
    block.hide_render = True
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 2, 3
    bpy.context.scene.render.filepath = cache_file()
    bpy.ops.render.render(animation=True)
    assert any("hidden in them" in text for _, text in jobs.messages())


def test_the_pin_tool_has_the_switch_where_there_are_handles():
    bar = scenes.bar()
    scenes.activate(bar)
    shown = []
    ARAPFIELDS_TOOL_pin.draw_settings(bpy.context, Layout(shown), None)
    assert "Contact" not in shown
    bar = scenes.bar_with_handles()[0]
    scenes.activate(bar)
    ARAPFIELDS_TOOL_pin.draw_settings(bpy.context, Layout(shown), None)
    assert shown.count("Contact") == 1


# The dots that show where a live shape presses.


def test_dots_come_back_with_what_undo_brings_back():
    """Of the shape that comes back, and none where it lies free."""
    bar, block, _ = pressed()
    down, size = bpy.data.objects["Moving"].location.z, max(bar.dimensions)
    bpy.data.objects["Moving"].location.z += 0.8
    scenes.activate(block, bar)
    bpy.ops.arapfields.add_obstacle()
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.arapfields.live(kind="DEFORM")
    lowest(bar)
    bpy.ops.ed.undo_push(message="live")
    bpy.data.objects["Moving"].location.z = down
    bpy.context.view_layer.update()
    lowest(bar)
    bpy.ops.ed.undo_push(message="down")
    pressing = recovery.touching_points()
    assert len(pressing) > 3
    for again, presses in zip("urururuurr", (0, 1, 0, 1, 0, 1, 0, None, 0, 1), strict=True):
        (bpy.ops.ed.undo if again == "u" else bpy.ops.ed.redo)()
        lowest(bpy.data.objects["Bar"])
        scenes.activate(bpy.data.objects["Bar"])
        found = recovery.touching_points()
        assert bool(len(found)) == bool(presses), (again, presses, len(found))
        if presses:
            nearest = np.linalg.norm(found[:, None] - pressing, axis=2).min(axis=1)
            assert nearest.max() < 0.05 * size


# Collections in the list of obstacles.


def test_a_collection_that_puts_nothing_in_the_way_is_said():
    bar, *_ = scenes.bar_with_handles()
    block = scenes.bar("Block")
    block.location.z = -1
    group, real, placed = (
        bar.arapfields.contact,
        *(bpy.data.collections.new(name) for name in ("Real", "Set")),
    )
    for one in (real, placed):
        bpy.context.scene.collection.children.link(one)
    real.objects.link(block)
    bpy.context.collection.objects.unlink(block)
    instance = bpy.data.objects.new("Placed", None)
    placed.objects.link(instance)
    instance.instance_type, instance.instance_collection = "COLLECTION", real
    group.use = True
    entry = group.obstacle_list.add()
    entry.group = real
    assert contact.entry_refusal(bar, entry) is None
    bpy.context.view_layer.layer_collection.children["Real"].exclude = True
    bpy.context.view_layer.update()
    assert str(contact.refusal(bar)) == "Real has no visible mesh that is in the way"
    entry.group = placed
    assert str(contact.refusal(bar)) == "Placed is an instance; make it real to have it in the way"
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="Placed is an instance"):
        bpy.ops.arapfields.deform()
