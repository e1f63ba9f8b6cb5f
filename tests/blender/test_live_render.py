# SPDX-License-Identifier: GPL-3.0-or-later
"""What renders show of a source that is live, and of a file that is opened without the extension."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import animated
    from support.blender.live import step
    from support.blender.scenes import camera
    from support.blender.stacks import build, local_points

    from addon.core.runtime import jobs
    from addon.live import sessions

pytestmark = pytest.mark.in_blender


def picture(path):
    """(height, width, 4) pixels of a file."""
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    width, height = image.size
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)


def counted(item):
    """How many visible meshes of the evaluated scene are this source's or its results'."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    shown = [i.object.original for i in depsgraph.object_instances if i.object.type == "MESH"]
    return sum(one.name.startswith(item.name) and not one.hide_render for one in shown)


@pytest.mark.parametrize("target", ["MODIFIER", "NEW"])
def test_a_render_of_an_animation_follows_the_handles_while_live(target):
    bar = animated()
    bar.arapfields.result = target
    scene, folder = camera(), Path(tempfile.mkdtemp())
    scene.frame_set(1)
    bpy.ops.arapfields.live()
    assert counted(bar) == 1
    scene.frame_start, scene.frame_end, scene.render.filepath = 1, 5, str(folder / "frame")
    bpy.ops.render.render(animation=True)
    assert sessions.is_live(bar) and not sessions.live.is_rendering
    shown = bar if target == "MODIFIER" else bpy.data.objects["Bar_live"]
    heights = []
    for frame in range(1, 6):
        seen = picture(folder / f"frame{frame:04}.png")[:, :, 3] > 0.5
        scene.frame_set(frame)
        step(refined=True)
        points = scenes.world_points(shown)
        right = points[points[:, 0] > 0.7]
        rows = np.flatnonzero(seen[:, int((0.85 + 1.6) / 3.2 * 48)]) / 48 * 3.2 - 1.6
        assert abs(rows.mean() - right[:, 2].mean()) < 3.2 / 48 * 1.5, frame  # pixels
        heights.append(rows.mean())
    assert np.all(np.diff(heights) > 0.03), heights
    assert counted(bar) == 1


def test_a_handle_hidden_in_renders_is_said():
    jobs.board.messages.clear()
    animated()
    scene = camera(16)
    bpy.data.objects["Moving"].hide_render = True
    bpy.ops.arapfields.live()
    scene.frame_start, scene.frame_end, scene.render.filepath = 1, 2, tempfile.mkdtemp() + "/frame"
    bpy.ops.render.render(animation=True)
    said = [text for _, text in jobs.messages()]
    assert said == ["Bar: Renders do not follow what is hidden in them: Moving"]


def test_a_file_looks_the_same_without_the_extension():
    """Opened by a Blender that never heard of it: the same points bit for bit, the same picture."""
    for stack in (["FIELD", "SUBSURF"], ["MIRROR", "FIELD"]):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        build(stack)
        scene, folder = camera(), Path(tempfile.mkdtemp())
        bpy.data.objects["Bar"].modifiers["ARAP Fields"].show_viewport = True
        scene.render.filepath = str(folder / "with.png")
        bpy.ops.render.render(write_still=True)
        np.save(folder / "points.npy", local_points(bpy.data.objects["Bar"]))
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "file.blend"))
        script = f"""
import bpy, numpy as np
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.open_mainfile(filepath={str(folder / "file.blend")!r})
assert not hasattr(bpy.types.Object, "arapfields")
mesh = bpy.data.objects["Bar"].evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
flat = np.empty(3 * len(mesh.vertices), np.float32)
mesh.vertices.foreach_get("co", flat)
assert flat.tobytes() == np.load({str(folder / "points.npy")!r}).tobytes(), "points"
bpy.context.scene.render.filepath = {str(folder / "without.png")!r}
bpy.ops.render.render(write_still=True)
import os
os._exit(7)
"""
        program = bpy.app.binary_path  # empty where Blender is a module of Python
        command = [program, "-b", "--factory-startup", "--python-expr"] if program else [sys.executable, "-c"]
        done = subprocess.run([*command, script], capture_output=True, text=True)
        assert done.returncode == 7, done.stderr
        with_it, without = (picture(folder / f"{name}.png") for name in ("with", "without"))
        assert (with_it[:, :, 3] > 0.5).sum() > 100 and np.array_equal(with_it, without)
