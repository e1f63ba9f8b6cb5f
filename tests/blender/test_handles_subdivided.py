# SPDX-License-Identifier: GPL-3.0-or-later
"""Boxes around what a Subdivision Surface shows, where the cage lies outside of them."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bmesh
    import bpy
    from support.blender import scenes
    from support.blender.live import step

    from addon.handles import subdivided

pytestmark = pytest.mark.in_blender

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
    places, seen = subdivided.read(bpy.context, cube, True, [])
    assert len(places) == len(seen) < subdivided.MOST
    assert np.abs(np.abs(places).max(axis=1) - 1.0).max() < 1e-6  # on the cage
    assert np.abs(seen - places).max() > 0.1 and len(bpy.data.scenes) == 1
    assert cube.modifiers["Subdivision"].levels == 6
