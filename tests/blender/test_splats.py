# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats: imported, posed, written."""

import itertools
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scans, scenes
    from support.blender.live import pin, step
    from support.blender.scans import file_values, given, places, scan, shown, vector_values
    from support.files import splats
    from support.files.archives import files_of_at_most

    import arapfields as af
    from addon.core.geometry.spaces import transform
    from addon.field_modifier import motion
    from addon.live import sessions
    from addon.pin_tool import hover, screen

pytestmark = pytest.mark.in_blender

# Gaussian splats as importers leave them: posed live, their attributes by the modifier.

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
    with pytest.raises(RuntimeError, match="scale_1 of its splats has invalid values"):
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
    with pytest.raises(RuntimeError, match="its splats have 15 colors"):
        bpy.ops.arapfields.deform()
    data.attributes.new("f_rest_44", "FLOAT", "POINT")
    data.attributes["rot_0"].data[2].value = 1.0
    with pytest.raises(RuntimeError, match="its scale stretches splats"):
        bpy.ops.arapfields.deform()


# Posed scans of splats that leave Blender: as shown, and frame by frame.

CLOSE = 1e-5
PLACE = ((0.3, -1.0, 0.2), 0.7, "X")  # of the object: translation, angle, axis


def gap(one, other):
    """The largest difference of splats, with rotations up to their sign."""
    signs = np.sign(np.sum(one.rotations * other.rotations, axis=1, keepdims=True))
    gaps = [np.abs(getattr(one, name) - getattr(other, name)) for name in ("centers", "scales", "opacities")]
    gaps += [np.abs(one.harmonics - other.harmonics), np.abs(one.rotations - signs * other.rotations)]
    return max(gap.max() for gap in gaps)


def placed(item):
    shift, angle, axis = PLACE
    return Matrix.Translation(shift) @ Matrix.Rotation(angle, 4, axis)


def seen(item):
    """The splats that the file layout's attributes show, in the world, by the library."""
    values, rest = shown(item, file_values), given()
    turns = np.column_stack([values[f"rot_{k}"] for k in range(4)])
    scales = np.exp(np.column_stack([values[f"scale_{k}"] for k in range(3)]))
    colours = np.concatenate(
        [
            np.column_stack([values[f"f_dc_{k}"] for k in range(3)])[:, :, None],
            np.column_stack([values[f"f_rest_{k}"] for k in range(45)]).reshape(len(rest), 3, 15),
        ],
        axis=2,
    )
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    splats = af.GaussianSplats(places(item), turns, scales, rest.opacities, colours.swapaxes(1, 2))
    return splats.transformed(np.array(item.matrix_world))


def test_what_is_shown_is_written_in_each_format(tmp_path):
    item, moving = scan(given(), file_values, "POINTCLOUD")
    for one in (item, *(entry.empty for entry in item.arapfields.handles)):
        one.matrix_world = placed(one) @ one.matrix_world
    bpy.context.view_layer.update()
    bpy.ops.arapfields.set_rest()
    bpy.ops.arapfields.live()
    moving.location.z += 0.5
    step(refined=True)
    scenes.activate(item)
    bpy.ops.arapfields.live_keep()
    wanted = seen(item)
    assert gap(wanted, given().transformed(np.array(item.matrix_world))) > 0.1
    for name in ("a.ply", "b.glb"):
        assert bpy.ops.arapfields.export_splats(filepath=str(tmp_path / name)) == {"FINISHED"}
    assert gap(af.GaussianSplats.load(tmp_path / "a.ply"), wanted) < CLOSE
    back, name = splats.gltf(tmp_path / "b.glb")
    assert name == "Scan" and gap(splats.with_z_up(back), wanted) < CLOSE
    item.modifiers[0].show_viewport = False
    bpy.ops.arapfields.export_splats(filepath=str(tmp_path / "rest.ply"))
    rest = given().transformed(np.array(item.matrix_world))
    assert gap(af.GaussianSplats.load(tmp_path / "rest.ply"), rest) < CLOSE


@pytest.mark.parametrize("layout", ["vector_values", "own_values"])
def test_other_layouts_are_written_alike(layout, tmp_path):
    _, moving = scan(given(), getattr(scans, layout))
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    bpy.ops.arapfields.export_splats(filepath=str(tmp_path / "a.ply"))
    _, moving = scan(given(), file_values)
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    bpy.ops.arapfields.export_splats(filepath=str(tmp_path / "b.ply"))
    one, other = (af.GaussianSplats.load(tmp_path / name) for name in ("a.ply", "b.ply"))
    assert gap(one, other) < 2e-4 and gap(one, given()) > 0.1


def animated(frames=4):
    item, moving = scan(given(), file_values, "POINTCLOUD")
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, frames
    for frame, height in ((1, 0.0), (frames, 0.5)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
        item.location.x = frame / 10
        item.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    scenes.activate(item)
    return item


def test_a_bake_writes_the_frames_that_live_mode_shows(tmp_path):
    item = animated()
    for kind in ("PLY", "GLTF"):
        given_ = {"splat_format": kind, "folder": str(tmp_path / "scans")}
        assert bpy.ops.arapfields.bake(**given_) == {"FINISHED"}
    names = sorted(path.name for path in (tmp_path / "scans").iterdir())
    assert names == sorted(
        f"untitled~Scene~Scan.{frame:04d}.{end}"
        for frame, end in itertools.product(range(1, 5), ("ply", "glb"))
    )
    assert not item.modifiers
    bpy.ops.arapfields.live()
    for frame in (1, 3, 4):
        bpy.context.scene.frame_set(frame)
        step(refined=True)
        path = tmp_path / "scans" / f"untitled~Scene~Scan.{frame:04d}.ply"
        one, other = af.GaussianSplats.load(path), splats.gltf(path.with_suffix(".glb"))[0]
        assert gap(one, seen(item)) < CLOSE
        assert gap(one, splats.with_z_up(other)) < CLOSE
    assert np.abs(one.centers - given().centers).max() > 0.5


def test_an_earlier_bake_stays_where_one_fails(tmp_path):
    item = animated(3)
    path = str(tmp_path / "walk.ply")
    bpy.ops.arapfields.bake(filepath=path)
    before = {one.name: one.read_bytes() for one in tmp_path.iterdir()}
    assert sorted(before) == [f"walk.{frame:04d}.ply" for frame in (1, 2, 3)]
    with pytest.raises(RuntimeError, match="Overwrite replaces it"):
        bpy.ops.arapfields.bake(filepath=path)
    with files_of_at_most(40_000), pytest.raises(RuntimeError, match="walk"):
        bpy.ops.arapfields.bake(filepath=path, overwrite=True)
    assert {one.name: one.read_bytes() for one in tmp_path.iterdir()} == before
    assert bpy.ops.arapfields.bake(filepath=path, overwrite=True, subframes=2) == {"FINISHED"}
    names = sorted(one.name for one in tmp_path.iterdir())
    assert names == ["walk.0001.5.ply", "walk.0001.ply", "walk.0002.5.ply", "walk.0002.ply", "walk.0003.ply"]
    item.arapfields.result = "NEW"
    with pytest.raises(RuntimeError, match="choose Original Mesh as geometry"):
        bpy.ops.arapfields.bake(filepath=path, overwrite=True)


def test_usd_is_written_where_it_knows_splats(tmp_path):
    from arapfields.cli import usd

    animated(3)
    path = tmp_path / "walk.usdc"
    try:
        usd.require_usd_splats()
    except ImportError as error:
        pytest.skip(str(error))
    assert bpy.ops.arapfields.bake(filepath=str(path), splat_format="USD") == {"FINISHED"}
    assert bpy.ops.arapfields.bake(filepath=str(tmp_path / "walk.ply")) == {"FINISHED"}
    for frame in (1, 2, 3):
        back, stage = splats.usd(path, frame)
        assert gap(back, af.GaussianSplats.load(tmp_path / f"walk.{frame:04d}.ply")) < CLOSE
    assert stage.GetEndTimeCode() == 3 and stage.GetTimeCodesPerSecond() == 24
    bpy.context.scene.frame_set(1)
    bpy.ops.arapfields.export_splats(filepath=str(tmp_path / "still.usda"))
    assert gap(splats.usd(tmp_path / "still.usda")[0], seen(bpy.context.object)) < CLOSE
    patch = pytest.MonkeyPatch()
    patch.setattr(usd, "SPLATS", "Unknown")
    with pytest.raises(RuntimeError, match="knows no Gaussian splats"):
        bpy.ops.arapfields.export_splats(filepath=str(path))
    with pytest.raises(RuntimeError, match="knows no Gaussian splats"):
        bpy.ops.arapfields.bake(filepath=str(path), splat_format="USD", overwrite=True)
    patch.undo()


def test_what_cannot_be_written_is_named(tmp_path):
    item, _ = scan(given(60), file_values)
    for path, word in (
        ("a.obj", "known are"),
        ("no/a.ply", "No such file or directory"),
        ("//a.ply", "Save the .blend first"),
    ):
        with pytest.raises(RuntimeError, match=word):
            bpy.ops.arapfields.export_splats(filepath=path if path.startswith("//") else str(tmp_path / path))
    item.scale.x = -1
    with pytest.raises(RuntimeError, match="mirrors or flattens"):
        bpy.ops.arapfields.export_splats(filepath=str(tmp_path / "a.ply"))
    assert not list(Path(tmp_path).iterdir())
    bar = scenes.bar_with_handles()[0]
    scenes.activate(bar)
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.arapfields.export_splats(filepath=str(tmp_path / "a.ply"))
