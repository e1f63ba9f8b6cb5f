# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats as importers leave them: posed live, their attributes by the modifier."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scans, scenes
    from support.blender.live import step
    from support.blender.pins import pin
    from support.blender.scans import file_values, given, places, scan, shown, vector_values

    from addon.core.geometry.spaces import transform
    from addon.field_modifier import motion
    from addon.live import sessions
    from addon.pin_tool import hover, screen

pytestmark = pytest.mark.in_blender

SINGLE = 2e-3  # of the size: the modifier has single precision, and live jets as well


def off(one, other):
    return max(np.abs(one[key] - other[key]).max() for key in other if key != "rot_euler")


@pytest.mark.parametrize(
    ("layout", "data"),
    [
        ("file_values", "MESH"),
        ("vector_values", "MESH"),
        ("own_values", "MESH"),
        ("own_values", "POINTCLOUD"),
    ],
)
def test_a_scan_is_posed_live_and_comes_back(layout, data, tmp_path):
    rest, values = given(), getattr(scans, layout)
    item, moving = scan(rest, values, data)
    assert item.type == data
    before = shown(item, values)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    moving.location.z += 0.5
    moving.rotation_euler.y = -0.8
    step(refined=True)
    moved = sessions.live[item.session_uid].solver.field.apply_to(rest, max_stretch=np.inf)
    posed = shown(item, values)
    assert np.abs(places(item) - moved.centers).max() < SINGLE
    assert off(posed, values(moved)) < SINGLE < 0.3 < off(posed, before)
    if values is vector_values:
        x, y, z = posed["rot_euler"].T  # Z Y X, as Blender's XYZ is: the turned x axis
        axis = np.column_stack([np.cos(y) * np.cos(z), np.cos(y) * np.sin(z), -np.sin(y)])
        w, i, j, k = np.asarray(moved.rotations).T
        turned = np.column_stack([1 - 2 * (j * j + k * k), 2 * (i * j + w * k), 2 * (i * k - w * j)])
        assert np.abs(axis - turned).max() < 5 * SINGLE and x.std() > 0.1
    scenes.activate(item)
    bpy.ops.arapfields.live_keep()
    kept = shown(item, values)
    assert off(kept, posed) == 0
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scan.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scan.blend"))
    item = bpy.data.objects["Scan"]
    assert off(shown(item, values), posed) == 0
    item.modifiers[0].show_viewport = False
    assert off(shown(item, values), before) == 0
    item.modifiers[0].show_viewport = True
    scenes.activate(item)
    bpy.ops.arapfields.remove_field()
    assert off(shown(item, values), before) == 0 and not item.modifiers
    assert not [one.name for one in item.data.attributes if one.name.startswith("ARAP")]


def test_the_button_poses_a_scan_and_off_restores_it():
    item, moving = scan(given(), file_values, "POINTCLOUD")
    before = shown(item, file_values)
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step()
    assert off(shown(item, file_values), before) > 0.05
    scenes.activate(item)
    bpy.ops.arapfields.live()
    assert off(shown(item, file_values), before) == 0 and not item.modifiers
    assert bpy.ops.arapfields.deform(samples=1000) == {"FINISHED"}
    assert off(shown(item, file_values), before) > 0.05
    assert item.modifiers[0].name == "ARAP Fields"


def test_the_splat_nearest_to_the_viewer_is_pinned_and_dragged():
    item = scan(given(), file_values, "POINTCLOUD")[0]
    for entry in list(item.arapfields.handles):
        bpy.data.objects.remove(entry.empty)
    item.arapfields.handles.clear()
    item.matrix_world = Matrix.Translation((0, 0, 0.3)) @ Matrix.Rotation(0.1, 4, "Z")
    bpy.context.view_layer.update()
    rest = places(item)
    seen = transform(np.array(item.matrix_world), rest)
    perspective, size = np.array([[2, 0, 0, 0], [0, 0, 2, 0], [0, 1, 0, 2.9], [0, 1, 0, 3]]), (400, 400)
    pixels = screen.project(perspective, size, seen)
    view = SimpleNamespace(perspective=perspective, size=size, scale=3.0, towards=(0, -1, 0), pixel=pixels[7])
    met = hover.splat_under(bpy.context, view, None)
    near = np.linalg.norm(pixels - view.pixel, axis=1) <= hover.SPLAT_REACH * view.scale
    front = seen[near][seen[near, 1].argmin()]
    assert met.kind == "SURFACE" and met.source.get() == item and np.ptp(seen[near, 1]) > 0.3
    assert np.abs(met.location - front).max() < 1e-6
    view.pixel = (5, 5)
    assert hover.splat_under(bpy.context, view, None) is None
    item.matrix_world = Matrix()
    bpy.context.view_layer.update()
    held, end = rest[rest[:, 0].argmin()], rest[rest[:, 0].argmax()]
    pin(item, held)
    pin(item, end + 0.01, target=end + np.array([0.0, 0.0, 0.5]))
    assert np.abs(motion.shown_points(item) - places(item)).max() < 1e-6
    way = np.linalg.norm(places(item) - rest, axis=1)
    assert way[rest[:, 0].argmax()] > 0.4 and way[rest[:, 0].argmin()] < 0.02


def test_what_splats_lack_is_named():
    item, _ = scan(given(60), file_values)
    data = item.data
    for call, arguments, word in (
        (bpy.ops.arapfields.deform, {"result": "NEW"}, "choose Original Mesh as geometry"),
        (bpy.ops.arapfields.export_animation, {}, "Export Splats and Bake Animation write them"),
    ):
        with pytest.raises(RuntimeError, match=word):
            call(**arguments)
    body, _, _ = scenes.bar_with_handles()
    other = item.copy()
    other.arapfields.handles.clear()
    bpy.context.scene.collection.objects.link(other)
    scenes.activate(other, body)
    with pytest.raises(RuntimeError, match="only handles of its own turn them"):
        bpy.ops.arapfields.carry()
    bpy.ops.arapfields.deform(samples=1000)
    with pytest.raises(RuntimeError, match="only handles of its own turn them"):
        bpy.ops.arapfields.field_as_nodes()
    with pytest.raises(RuntimeError, match="the mesh has no faces"):
        bpy.ops.arapfields.wrap(onto=other.name)
    bpy.data.objects.remove(other)
    scenes.activate(item)
    data.attributes["scale_1"].data[3].value = np.nan
    with pytest.raises(RuntimeError, match="scale_1 of its splats has NaN"):
        bpy.ops.arapfields.deform()
    data.attributes.remove(data.attributes["scale_1"])
    with pytest.raises(RuntimeError, match="its splats have no scale_1"):
        bpy.ops.arapfields.deform()
    data.attributes.new("scale_1", "FLOAT", "POINT")
    data.attributes.remove(data.attributes["f_rest_7"])
    with pytest.raises(RuntimeError, match="its splats have no f_rest_7"):
        bpy.ops.arapfields.deform()
    item.scale.x = 2
    data.attributes.remove(data.attributes["f_rest_44"])
    data.attributes.new("f_rest_7", "FLOAT", "POINT")
    with pytest.raises(RuntimeError, match="its splats have 15 colours"):
        bpy.ops.arapfields.deform()
    data.attributes.new("f_rest_44", "FLOAT", "POINT")
    data.attributes["rot_0"].data[2].value = 1.0
    with pytest.raises(RuntimeError, match="its scale stretches splats"):
        bpy.ops.arapfields.deform()
