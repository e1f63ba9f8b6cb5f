# SPDX-License-Identifier: GPL-3.0-or-later
"""Stylizing inside Blender."""

import json
import math

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

import arapfields

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.pins import pin
    from support.blender.styles import SETTINGS, ball

    from addon.core.runtime import jobs
    from addon.core.settings.styles import STYLES, style_identifier, style_name
    from addon.live import sessions

pytestmark = pytest.mark.in_blender


def test_a_ball_turns_towards_a_cube_and_keeps_its_mesh():
    item = ball()
    bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS)
    result = bpy.data.objects["Ball_stylized"]
    assert len(result.data.polygons) == len(item.data.polygons)
    assert json.loads(result["arapfields_report"])["preference"] > 0.75


@pytest.mark.parametrize("frame", ["UPRIGHT", "OBJECT", "WORLD", "EMPTY"])
def test_the_style_stands_along_the_chosen_axes(frame):
    """A ball, turned: the cube's axes are those along which its result is most flat."""
    item = ball()
    item.rotation_euler.z = math.radians(20)
    empty = scenes.cube_empty((0, 0, 0), (1, 1, 1), "Axes")
    empty.rotation_euler.z = math.radians(-25)
    bpy.context.view_layer.update()
    scenes.activate(item)
    item.arapfields.stylize.frame_object = empty
    bpy.ops.arapfields.stylize(style="CUBE", frame=frame, **SETTINGS)
    points = scenes.world_points(bpy.data.objects["Ball_stylized"])
    points -= points.mean(axis=0)

    def reach(degrees):
        turn = math.radians(degrees)
        return np.abs(points @ [math.cos(turn), math.sin(turn), 0]).max()

    # A cube reaches least along its axes.
    flattest = min((20, 0, -25), key=reach)
    assert flattest == {"UPRIGHT": 20, "OBJECT": 20, "WORLD": 0, "EMPTY": -25}[frame]


def test_imported_objects_are_styled_upright():
    """A ball, turned as an import turns objects: the flat side of a cone lies below, and there it stands."""
    item = ball()
    item.rotation_euler.x = math.radians(90)
    bpy.context.view_layer.update()
    lowest = scenes.world_points(item)[:, 2].argmin()
    start = scenes.world_points(item)[lowest]

    def low_and_high():
        points = scenes.world_points(bpy.data.objects["Ball_stylized"])
        radii = np.linalg.norm(points[:, :2] - points[:, :2].mean(axis=0), axis=1)
        heights = points[:, 2] - points[:, 2].min()
        return radii[heights < 0.1 * np.ptp(heights)].max(), radii[heights > 0.9 * np.ptp(heights)].max()

    bpy.ops.arapfields.stylize(style="CONE", **SETTINGS)
    assert item.arapfields.stylize.frame == "UPRIGHT"
    below, above = low_and_high()
    assert below > 1.5 * above
    moved = scenes.world_points(bpy.data.objects["Ball_stylized"])[lowest]
    assert np.linalg.norm(moved - start) < 0.05
    scenes.activate(item)
    bpy.ops.arapfields.stylize(style="CONE", frame="OBJECT", **SETTINGS)
    below, above = low_and_high()
    assert below < 1.5 * above


def test_a_vertex_group_bounds_the_region():
    item = ball()
    before = scenes.world_points(item)
    top = item.vertex_groups.new(name="top")
    top.add(np.flatnonzero(before[:, 2] > 0.2).tolist(), 1.0, "REPLACE")
    item.arapfields.stylize.region = "top"
    bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS)
    result = bpy.data.objects["Ball_stylized"]
    normals = np.array([face.normal for face in result.data.polygons])
    heights = np.array([face.center.z for face in item.data.polygons])
    agreement = np.abs(normals).max(axis=1)  # with the cube's axes
    assert agreement[heights > 0.5].mean() > agreement[heights < -0.5].mean() + 0.03


def test_the_menu_lists_the_librarys_styles():
    assert [name for name, _ in STYLES] == list(arapfields.style_names())
    assert all(style_name(style_identifier(name)) == name for name, _ in STYLES)


def test_an_objects_axes_and_its_shape_are_styles():
    """A box turned by 30°: both kinds flatten the ball along the box's axes."""
    item = ball()
    bpy.ops.mesh.primitive_cube_add(location=(5, 0, 0), rotation=(0, 0, math.radians(30)))
    box = bpy.context.object
    for kind in ("AXES", "OBJECT"):
        scenes.activate(item)
        item.arapfields.stylize.style_object = box
        bpy.ops.arapfields.stylize(style=kind, **SETTINGS)
        points = scenes.world_points(bpy.data.objects["Ball_stylized"])
        points -= points.mean(axis=0)
        reach = [np.abs(points @ [math.cos(a), math.sin(a), 0]).max() for a in np.radians([30, 75])]
        assert reach[0] < reach[1] - 0.02, kind


def test_custom_styles_that_give_no_normals_are_named():
    item = ball()
    cloud = bpy.data.meshes.new("Cloud")
    rng = np.random.default_rng(0)
    cloud.from_pydata(rng.normal(size=(300, 3)).tolist(), [], np.arange(300).reshape(-1, 3).tolist())
    for chosen, message in (
        (None, "Choose the object"),
        (bpy.data.objects.new("Cloud", cloud), "encloses no volume, and has 100 different face normals"),
        (bpy.data.objects.new("Empty Mesh", bpy.data.meshes.new("Empty Mesh")), "the mesh is empty"),
        (scenes.cube_empty((0, 0, 0), (1, 1, 1), "Axes"), "Axes is no mesh"),
    ):
        if chosen is not None and chosen.name not in bpy.context.collection.objects:
            bpy.context.collection.objects.link(chosen)
        scenes.activate(item)
        item.arapfields.stylize.style_object = chosen
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.arapfields.stylize(style="OBJECT", **SETTINGS)


def test_a_material_bounds_the_region():
    item = ball()
    for name in ("bottom", "top"):
        item.data.materials.append(bpy.data.materials.new(name))
    heights = np.array([face.center.z for face in item.data.polygons])
    item.data.polygons.foreach_set("material_index", (heights > 0.2).astype(np.int32))
    item.arapfields.stylize.region_material = bpy.data.materials["top"]
    bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS)
    result = bpy.data.objects["Ball_stylized"]
    agreement = np.abs(np.array([face.normal for face in result.data.polygons])).max(axis=1)
    assert agreement[heights > 0.5].mean() > agreement[heights < -0.5].mean() + 0.03
    scenes.activate(item)
    item.arapfields.stylize.region_material = bpy.data.materials.new("unused")
    with pytest.raises(RuntimeError, match="does not use the material unused"):
        bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS)


def test_what_is_said_of_the_handles_leaves_out_what_pins_keep_at_rest():
    item = ball()
    points = scenes.world_points(item)
    for side in (points[:, 0].argmax(), points[:, 0].argmin()):
        pin(item, points[side])
    sessions.end(bpy.context, item)
    scenes.activate(item)
    item.arapfields.stylize.use_handles = True
    jobs.board.messages.clear()
    assert item.arapfields.keep_rest
    assert bpy.ops.arapfields.stylize(style="CUBE", **SETTINGS) == {"FINISHED"}
    (line,) = (text for _, text in jobs.messages())
    report = json.loads(bpy.data.objects["Ball_stylized"]["arapfields_report"])
    errors = [handle["error_max"] for handle in report["handles"]]
    share = float(line.split("within ")[1].split("%")[0]) / 100
    size = np.ptp(points, axis=0).max()
    assert len(errors) == 3 and max(errors[:2]) <= share * size < errors[2]
