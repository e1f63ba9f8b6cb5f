# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake of a large mesh: what memory it takes, and whether a Blender without the extension plays it."""

import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import EXACT, solved

    from addon.core.runtime import jobs

pytestmark = pytest.mark.in_blender

SIDE, FRAMES = 500, 40  # 250,000 vertices; 120 MB of frames
MOST = 1e9  # bytes over idle that a bake may take
NOISE = 60e6  # bytes that the memory of a process comes and goes by: half of what the frames weigh


def torus():
    """A closed surface of SIDE² vertices, held at one side, whose other side turns and rises."""
    angle = np.arange(SIDE) * 2 * np.pi / SIDE
    around, across = np.meshgrid(angle, angle, indexing="ij")
    reach = 1.4 + 0.5 * np.cos(across)
    points = np.stack([reach * np.cos(around), reach * np.sin(around), 0.5 * np.sin(across)], axis=-1)
    i, j = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    ahead, up = (i + 1) % SIDE, (j + 1) % SIDE
    corners = np.stack([i * SIDE + j, ahead * SIDE + j, ahead * SIDE + up, i * SIDE + up], axis=-1)
    mesh = bpy.data.meshes.new("Torus")
    mesh.from_pydata(points.reshape(-1, 3).tolist(), [], corners.reshape(-1, 4).tolist())
    item = bpy.data.objects.new("Torus", mesh)
    bpy.context.collection.objects.link(item)
    empties = [scenes.cube_empty((side * 1.9, 0, 0), (0.4, 0.8, 0.8)) for side in (-1, 1)]
    bpy.context.view_layer.update()
    scenes.activate(*empties, item)
    bpy.ops.arapfields.add_handle()
    for frame, turn, height in ((1, 0.0, 0.0), (FRAMES, 2.0, 0.8)):
        empties[1].rotation_euler.x, empties[1].location.z = turn, height
        empties[1].keyframe_insert("rotation_euler", frame=frame)
        empties[1].keyframe_insert("location", frame=frame)
    scenes.activate(item)
    return item


def memory():
    """Bytes that the process holds in memory."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096


@pytest.mark.slow
def test_a_long_bake_of_a_large_mesh_takes_little_memory_and_plays_anywhere():
    item, folder = torus(), Path(tempfile.mkdtemp())
    bpy.context.scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "large.blend"))
    idle, sizes, ended = memory(), [], threading.Event()

    def watch():
        while not ended.wait(0.02):
            sizes.append((jobs.progress()[0], memory() - idle))

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        assert bpy.ops.arapfields.bake(start=1, end=FRAMES) == {"FINISHED"}
    finally:
        ended.set()
        thread.join()
    assert max(taken for _, taken in sizes) < MOST
    early, late = ([taken for share, taken in sizes if a < share <= b] for a, b in ((0.1, 0.4), (0.7, 1.0)))
    assert max(late) <= max(early) + NOISE
    size = (folder / "cache/large~Scene~Torus.pc2").stat().st_size
    assert size == 32 + 12 * SIDE * SIDE * FRAMES
    bpy.ops.wm.save_mainfile()
    frames = (1, FRAMES // 3, FRAMES)
    np.savez(folder / "solved.npz", **{str(frame): solved(item, frame) for frame in frames})
    script = f"""
import bpy, numpy as np
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.open_mainfile(filepath={str(folder / "large.blend")!r})
assert not hasattr(bpy.types.Object, "arapfields")
solved = np.load({str(folder / "solved.npz")!r})
for frame in solved.files:
    bpy.context.scene.frame_set(int(frame))
    mesh = bpy.data.objects["Torus"].evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    assert np.abs(flat.reshape(-1, 3) - solved[frame]).max() <= {EXACT}, frame
import os
os._exit(7)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 7, done.stderr
