# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports hold what a bake holds: all that the object carries, and a word on what a file cannot hold."""

import json
import subprocess
import sys

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import saved_animation
    from support.blender.riders import rider

    from addon.core.runtime import jobs

pytestmark = pytest.mark.in_blender

SUFFIXES = {"ABC": ".abc", "USD": ".usdc", "GLTF": ".glb"}
NEAR = 1e-5  # single precision, through exporters and importers
READER = """
import sys, json, bpy, numpy as np
bpy.ops.wm.read_factory_settings(use_empty=True)
kind, path, out, *frames = sys.argv[1:]
if kind == "ABC":
    bpy.ops.wm.alembic_import(filepath=path, set_frame_range=True, as_background_job=False)
elif kind == "USD":
    bpy.ops.wm.usd_import(filepath=path, set_frame_range=True)
else:
    bpy.ops.import_scene.gltf(filepath=path)
found = {}
for frame in map(int, frames):
    bpy.context.scene.frame_set(frame)
    for item in bpy.data.objects:
        if item.type == "MESH" and item.users_scene:
            evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
            mesh = evaluated.to_mesh()
            flat = np.empty(3 * len(mesh.vertices), np.float32)
            mesh.vertices.foreach_get("co", flat)
            world = np.array(evaluated.matrix_world)
            points = flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
            box = [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
            found.setdefault(item.name, {})[frame] = box
            evaluated.to_mesh_clear()
json.dump(found, open(out, "w"))
import os
os._exit(7)
"""


def knight():
    """A bar that carries meshes, one as a whole, in a saved file; (bar, {name: carried object}, folder)."""
    bar, folder = saved_animation()
    carried = {}
    for number in range(3):
        item = rider("MESH")
        item.name, item.location.y = f"Part {number}", 0.02 * number
        carried[item.name] = item
    scenes.activate(*carried.values(), bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    stiff = scenes.bar("Stiff", 0.2)
    stiff.location = (0.8, 0.0, 0.5)
    scenes.activate(stiff, bar)
    assert bpy.ops.arapfields.carry(way="RIGID") == {"FINISHED"}
    scenes.activate(bar)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 5
    bpy.context.scene.frame_set(1)
    return bar, {**carried, "Stiff": stiff}, folder


def boxes(items, frames=(1, 5)):
    """[(frame, bounding box)] of each object, sorted: importers and exporters change names."""
    found = []
    for item in items:
        each = {}
        for frame in frames:
            bpy.context.scene.frame_set(frame)
            points = scenes.world_points(item)
            each[frame] = [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
        found.append(each)
    return found


def imported(kind, path):
    out = path.with_suffix(".json")
    command = [sys.executable, "-c", READER, kind, str(path), str(out), "1", "5"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 7, done.stdout + done.stderr
    read = json.loads(out.read_text())
    out.unlink()
    return read


def alike(read, expected):
    """Whether each expected object is among those read, once, at all frames."""
    left = [{int(frame): box for frame, box in each.items()} for each in read.values()]
    for each in expected:
        near = [one for one in left if all(np.abs(np.array(one[f]) - each[f]).max() < NEAR for f in each)]
        if len(near) != 1:
            return False
        left.remove(near[0])
    return not left


def snapshot():
    kinds = bpy.data.objects, bpy.data.meshes, bpy.data.actions, bpy.data.shape_keys, bpy.data.node_groups
    stacks = {
        o.name: [(m.name, m.show_viewport, getattr(m, "filepath", "")) for m in o.modifiers] for o in kinds[0]
    }
    return [sorted(kind.keys()) for kind in kinds], stacks


@pytest.mark.parametrize("kind", SUFFIXES)
def test_a_file_holds_all_that_is_carried_whether_baked_or_not(kind):
    bar, carried, folder = knight()
    before, paths = snapshot(), [folder / f"{name}{SUFFIXES[kind]}" for name in ("solved", "baked")]
    assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(paths[0])) == {"FINISHED"}
    assert any("frames of 5 objects exported" in text for _, text in jobs.messages()), jobs.messages()
    assert not [text for level, text in jobs.messages() if level != "INFO"]
    assert snapshot() == before
    assert bpy.ops.arapfields.bake(start=1, end=5) == {"FINISHED"}
    expected = boxes([bar, *carried.values()])
    assert all(np.abs(np.array(one[5]) - one[1]).max() > 0.05 for one in expected)
    bpy.context.scene.frame_set(1)
    scenes.activate(bar)
    assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(paths[1])) == {"FINISHED"}
    for path in paths:
        assert alike(imported(kind, path), expected), (path.name, imported(kind, path), expected)


@pytest.mark.parametrize("kind", SUFFIXES)
def test_what_a_file_does_not_hold_is_named(kind):
    bar, carried, folder = knight()
    hair, hidden = rider("CURVES"), carried["Part 1"]
    scenes.activate(hair, bar)
    bpy.ops.arapfields.carry()
    hidden.hide_set(True)
    scenes.activate(bar)
    for name, word in (("solved", "bake, then export"), ("baked", "holds none of its kind")):
        path = folder / f"{name}{SUFFIXES[kind]}"
        assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(path)) == {"FINISHED"}
        told = " ".join(text for level, text in jobs.messages() if level == "WARNING")
        assert "Part 1 is hidden" in told or "Part 1" in told.split(" is not in")[0], told
        if name == "solved" or kind == "GLTF":
            assert "Hair" in told and word in told, told
        assert bpy.ops.arapfields.bake(start=1, end=5) == {"FINISHED"}
        scenes.activate(bar)
