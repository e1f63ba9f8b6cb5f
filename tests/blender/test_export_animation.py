# SPDX-License-Identifier: GPL-3.0-or-later
"""Alembic, USD and glTF with what the object does, read back by another Blender, by usd-core and by hand."""

import contextlib
import json
import shutil
import struct
import subprocess
import sys
import types

import numpy as np
import pytest
from pxr import UsdGeom
from support.blender.inside import IN_BLENDER
from support.files.full_disk import files_of_at_most

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import saved_animation

pytestmark = pytest.mark.in_blender

EXACT = 1e-6  # of the object's size: single precision
READER = """
import sys, json, bpy, numpy as np
bpy.ops.wm.read_factory_settings(use_empty=True)
kind, path, out, fps, first, last = sys.argv[1:7]
bpy.context.scene.render.fps = int(fps)
if kind == "ABC":
    bpy.ops.wm.alembic_import(filepath=path, set_frame_range=True, as_background_job=False)
elif kind == "USD":
    bpy.ops.wm.usd_import(filepath=path, set_frame_range=True)
else:
    bpy.ops.import_scene.gltf(filepath=path)
item = next(o for o in bpy.data.objects if o.type == "MESH")
scene, found = bpy.context.scene, {}
for frame in range(int(first), int(last) + 1):
    scene.frame_set(frame)
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    world = np.array(evaluated.matrix_world)
    found[str(frame)] = flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
    if kind == "GLTF":
        index = np.empty(len(mesh.vertices), np.float32)
        mesh.attributes["_ORIGINAL_INDEX"].data.foreach_get("value", index)
        found["index"] = index
    evaluated.to_mesh_clear()
np.savez(out, range=[scene.frame_start, scene.frame_end], **found)
import os
os._exit(7)
"""


def scene_to_export():
    """A bar that moves and bends from frame 3 to 7, at 25 frames a second, in a saved file; (bar, folder)."""
    bar, folder = saved_animation()
    bar.location, bar.rotation_euler.z, bar.scale.y = (0.3, 0.2, 0.1), 0.4, 1.2
    index = bar.data.attributes.new("_ORIGINAL_INDEX", "FLOAT", "POINT")
    index.data.foreach_set("value", np.arange(len(bar.data.vertices), dtype=np.float32))
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = 25, 2, 5
    scene.world = bpy.data.worlds.new("World")  # which is no part of the object
    scene.world.use_nodes = True
    return bar, folder


def shown(item, frames):
    """{frame: (n, 3) world points}."""
    contents = {}
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        contents[frame] = scenes.world_points(item)
    return contents


def state(item):
    flags = [(m.name, m.type, m.show_viewport, m.show_render) for m in item.modifiers]
    kinds = bpy.data.objects, bpy.data.meshes, bpy.data.actions, bpy.data.shape_keys, bpy.data.scenes
    scene = bpy.context.scene
    return (
        flags,
        [sorted(kind.keys()) for kind in kinds],
        (scene.frame_start, scene.frame_end, scene.frame_current),
        [o.name for o in bpy.context.selected_objects],
    )


@pytest.mark.parametrize("kind", ["ABC", "USD", "GLTF"])
def test_what_is_exported_is_read_back(kind):
    """By Blender itself, in a process that never heard of the extension."""
    bar, folder = scene_to_export()
    path = folder / f"Bar{dict(ABC='.abc', USD='.usdc', GLTF='.glb')[kind]}"
    bpy.context.scene.frame_set(4)
    before = state(bar)
    assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(path)) == {"FINISHED"}
    assert state(bar) == before and sorted(p.name for p in folder.iterdir()) == [path.name, "scene.blend"]
    bpy.ops.arapfields.bake()
    expected = shown(bar, range(2, 6))
    first = path.stat().st_size
    assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(path)) == {"FINISHED"}
    assert abs(path.stat().st_size - first) < 100  # from the bake as well: nothing else is in it
    out = folder / "found.npz"
    command = [sys.executable, "-c", READER, kind, str(path), str(out), "25", "2", "5"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 7, done.stdout + done.stderr
    read = np.load(out)
    size = np.ptp(expected[2], axis=0).max()
    index = read["index"].astype(int) if kind == "GLTF" else slice(None)
    for frame, points in expected.items():
        assert np.abs(read[str(frame)] - points[index]).max() <= EXACT * size, frame
    if kind == "GLTF":
        assert set(index) == set(range(len(bar.data.vertices)))
    else:
        assert read["range"].tolist() == [2, 5]


def gltf(path):
    """The JSON of a .glb file."""
    content = path.read_bytes()
    (length,) = struct.unpack("<I", content[12:16])
    return json.loads(content[20 : 20 + length])


def test_the_times_of_a_gltf_are_the_frames_seconds():
    _, folder = scene_to_export()
    bpy.ops.arapfields.export_animation(format="GLTF", filepath=str(folder / "a.glb"))
    header = gltf(folder / "a.glb")
    (animation,) = header["animations"]
    times = header["accessors"][animation["samplers"][0]["input"]]
    assert np.allclose([*times["min"], *times["max"]], [2 / 25, 5 / 25]) and times["count"] == 4
    assert len(header["meshes"][0]["primitives"][0]["targets"]) == 4


def test_a_gltf_has_the_materials_of_the_object():
    bar, folder = scene_to_export()
    bar.data.materials.append(bpy.data.materials.new("Mesh"))
    bar.material_slots[0].link = "OBJECT"
    bar.material_slots[0].material = bpy.data.materials.new("Object")
    bpy.ops.arapfields.export_animation(format="GLTF", filepath=str(folder / "a.glb"))
    assert [one["name"] for one in gltf(folder / "a.glb")["materials"]] == ["Object"]


def test_the_times_of_an_alembic_are_seconds():
    """A scene of twice the rate finds each frame at twice its number."""
    bar, folder = scene_to_export()
    bpy.ops.arapfields.bake()
    expected = shown(bar, range(2, 6))
    path, out = folder / "Bar.abc", folder / "found.npz"
    bpy.ops.arapfields.export_animation(format="ABC", filepath=str(path))
    command = [sys.executable, "-c", READER, "ABC", str(path), str(out), "50", "4", "10"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 7, done.stdout + done.stderr
    read = np.load(out)
    assert read["range"].tolist() == [4, 10]
    for frame, points in expected.items():
        assert np.abs(read[str(2 * frame)] - points).max() <= EXACT * np.ptp(points, axis=0).max(), frame


def test_usd_is_what_its_own_library_reads():
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    bar, folder = scene_to_export()
    bpy.ops.arapfields.bake(subframes=2)
    path = folder / "Bar.usdc"
    bpy.ops.arapfields.export_animation(format="USD", filepath=str(path))
    stage = usd.Stage.Open(str(path))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (2, 5)
    assert stage.GetTimeCodesPerSecond() == 25
    (mesh,) = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    for frame, points in shown(bar, range(2, 6)).items():
        local = np.array(mesh.GetPointsAttr().Get(frame), dtype=float)
        matrix = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(mesh.GetPrim()))
        world = local @ matrix[:3, :3] + matrix[3, :3]
        assert np.abs(world - points).max() <= EXACT * np.ptp(points, axis=0).max(), frame


@contextlib.contextmanager
def little_room():
    usage, shutil.disk_usage = shutil.disk_usage, lambda _: types.SimpleNamespace(free=10_000)
    try:
        yield
    finally:
        shutil.disk_usage = usage


@pytest.mark.parametrize("kind", ["ABC", "USD", "GLTF"])
def test_an_export_that_fails_is_named_and_changes_nothing(kind):
    bar, folder = scene_to_export()
    bpy.ops.arapfields.bake()
    path = folder / f"Bar{dict(ABC='.abc', USD='.usdc', GLTF='.glb')[kind]}"
    path.write_bytes(b"before")
    before = state(bar)
    full = {"no room": little_room()}
    if kind != "ABC":  # Alembic's Blender ends there
        full["a limit"] = files_of_at_most(3000)
    for name, disk in full.items():
        with disk, pytest.raises(RuntimeError, match=path.name):
            bpy.ops.arapfields.export_animation(format=kind, filepath=str(path))
        assert path.read_bytes() == b"before"
        for one, other in zip(state(bar), before, strict=True):
            assert one == other, (name, one, other)
    (folder / "cache/scene~Scene~Bar.pc2").unlink()
    with pytest.raises(RuntimeError, match="is not there"):
        bpy.ops.arapfields.export_animation(format=kind, filepath=str(path))
    with pytest.raises(RuntimeError, match="no such folder"):
        bpy.ops.arapfields.export_animation(format=kind, filepath=str(folder / "gone/too" / path.name))
    assert path.read_bytes() == b"before"
