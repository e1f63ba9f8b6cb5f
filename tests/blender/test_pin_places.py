# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a pin's place is at rest, on the screen, and what it is called."""

import itertools

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.pins import pin

    from addon.core.geometry.spaces import transform
    from addon.core.runtime import jobs
    from addon.field_modifier import motion
    from addon.handles import empties
    from addon.handles.palette import PALETTE, free_colour
    from addon.pin_tool import pins, places, screen

pytestmark = pytest.mark.in_blender


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_pin_on_a_deformed_mesh_is_at_rest_where_its_place_was(turn):
    """For a mesh that has moved rigidly the place, the turn and the motion of the pin are known."""
    bar = scenes.bar()
    bar.matrix_world = Matrix.Translation((1, 2, 3)) @ Matrix.Rotation(0.4, 4, "X") @ Matrix.Scale(2.0, 4)
    bpy.context.view_layer.update()
    world = np.array(bar.matrix_world)
    move = np.array(Matrix.Translation((0.3, 0.1, -0.2)) @ Matrix.Rotation(turn, 4, "Z"))
    local = np.array([v.co for v in bar.data.vertices])
    motion.bind(bpy.context, bar)
    motion.write(bar, motion.Motion(transform(move, local) - local))
    bpy.context.view_layer.update()
    place = np.array([0.61, 0.07, 0.25])
    now = transform(world @ move, place[None])[0]
    entry = pins.place(bpy.context, bar, now, 0.2)
    rest = empties.rest_box(bar, entry)
    assert np.abs(rest[:3, 3] - transform(world, place[None])[0]).max() < 1e-5
    assert np.abs(rest[:3, :3] - 0.2 * np.eye(3)).max() < 1e-6
    placed = np.array(entry.empty.matrix_world)
    assert np.abs(placed[:3, 3] - now).max() < 1e-5
    turned = (world @ move @ np.linalg.inv(world))[:3, :3]
    assert np.abs(placed[:3, :3] - turned).max() < 1e-4


def test_a_click_where_a_later_modifier_moves_the_shape_is_said():
    """The pin stands on the shape before that modifier. One that but refines it says nothing."""
    bar = scenes.bar()
    pin(bar, (-1, 0, 0.25))
    for kind, said in (("SUBSURF", []), ("DISPLACE", ["Displace"])):
        modifier = bar.modifiers.new(kind.title(), kind)
        if said:
            modifier.direction, modifier.mid_level, modifier.strength = "Z", 0.0, 0.5
        bpy.context.view_layer.update()
        mesh = bar.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        face = max(mesh.polygons, key=lambda one: one.center.z)
        jobs.forget_messages()
        pin(bar, bar.matrix_world @ face.center, face=face.index, face_count=len(mesh.polygons))
        found = [text for level, text in jobs.messages() if level == "WARNING"]
        assert [name for name in said if any(f"modifier {name} moves" in text for text in found)] == said
        assert len(found) == len(said)


def test_a_known_face_decides_where_surfaces_touch():
    """Two sheets at rest apart lie on one another: the face tells which of them was hit."""
    points = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    mesh = bpy.data.meshes.new("Sheets")
    mesh.from_pydata(points, [], [(0, 1, 2, 3), (4, 5, 6, 7)])
    item = bpy.data.objects.new("Sheets", mesh)
    bpy.context.collection.objects.link(item)
    scenes.activate(item)
    motion.bind(bpy.context, item)
    motion.write(item, motion.Motion(np.array([(0, 0, -z) for *_, z in points], float)))
    bpy.context.view_layer.update()
    for face in (0, 1):
        place = places.find(bpy.context, item, np.array([0.3, 0.4, 0.0]), 0.1, face, 2)
        assert np.allclose(place.rest, [0.3, 0.4, face], atol=1e-6)


def test_under_a_subdivision_the_place_is_found_by_nearness():
    bar = scenes.bar()
    bar.modifiers.new("Subdivision", "SUBSURF").levels = 1
    bpy.context.view_layer.update()
    pin(bar, (1.0, 0.0, 0.25), target=(1.0, 0.0, 0.6))
    assert [m.type for m in bar.modifiers] == ["NODES", "SUBSURF"]
    shown = scenes.world_points(bar)
    top = shown[np.abs(shown - [0, 0, 0.25]).sum(axis=1).argmin()]
    empty = pin(bar, top, 0.1)
    entry = bar.arapfields.handles[1]
    assert entry.empty == empty and np.abs(np.array(entry.rest).reshape(4, 4)[2, 3] - 0.25) < 0.02


def test_names_by_what_is_held_and_colours_apart():
    assert len(set(PALETTE)) >= 16
    apart = [np.linalg.norm(np.subtract(a, b)) for a, b in itertools.combinations(PALETTE, 2)]
    assert min(apart) > 0.2
    bar = scenes.bar()
    for name, side in (("hoof L", 1), ("hoof R", -1)):
        group = bar.vertex_groups.new(name=name)
        group.add([v.index for v in bar.data.vertices if v.co.x * side > 0.5], 1.0, "REPLACE")
    names = [pin(bar, (x, 0.0, 0.25), 0.1).name for x in (0.9, -0.9, 0.0, 0.8)]
    assert names == ["hoof L", "hoof R", "Pin 3", "hoof L.001"]
    colours = [tuple(entry.colour) for entry in bar.arapfields.handles]
    assert len(set(colours)) == 4
    bar.arapfields.handles.remove(1)
    assert np.allclose(free_colour(bar.arapfields.handles), colours[1])


def test_screen_places():
    wide = np.array([[0.5, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    spots = screen.project(wide, (200, 100), [(0, 0, 0), (2, 0, 0), (0, -1, 0)])
    assert np.allclose(spots, [(100, 50), (200, 50), (100, 0)])
    assert np.isclose(screen.pixel_size(wide, (200, 100), (0, 0, 0)), 0.02)
    deep = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, -1, 0.0]])  # looks along -z
    assert np.isnan(screen.project(deep, (200, 200), (0, 0, 1))).all()
    assert np.isclose(screen.pixel_size(deep, (200, 200), (0, 0, -3)), 3 / 100)
    assert screen.nearest(spots, (104, 47), 6) == 0 and screen.nearest(spots, (104, 47), 4) == -1
    assert screen.nearest(np.full((1, 2), np.nan), (0, 0), 9) == -1
    assert np.isclose(screen.turn_between((0, 0), (1, 0), (0, 5)), np.pi / 2)
