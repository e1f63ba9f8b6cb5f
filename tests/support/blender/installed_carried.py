# SPDX-License-Identifier: GPL-3.0-or-later
"""Script for a separate Blender: the extension from a zip carries all kinds of objects in live mode,
through undo, in a render at a frame and in a bake, which plays without the extension.

blender --background --python installed_carried.py -- ZIP
"""

import ctypes.util
import importlib
import os
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from support.blender import installed

NEAR = 0.12  # largest difference to the handle's motion, for a bar of length 2: the field is not rigid


def check(items, rest, shift, what):
    import numpy as np
    from support.blender.riders import shown

    for name, before in zip(items, rest, strict=True):
        off = np.abs(shown(bpy.data.objects[name]) - before - [0, 0, shift]).max()
        assert off < NEAR, (what, name, off)


def use():
    from support.blender import scenes
    from support.blender.riders import WITH_PENCILS, body, rider, shown

    sessions = importlib.import_module(f"{installed.MODULE}.live.sessions")
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.context.preferences.edit.use_global_undo = True
    bar, moving = body()
    kinds = ["MESH", "CURVES", "CURVE", "LATTICE", "EMPTY", "ARMATURE"]
    kinds += ["GREASEPENCIL"] if WITH_PENCILS else []
    items = [rider(kind).name for kind in kinds]
    bpy.context.view_layer.update()
    rest = [shown(bpy.data.objects[name]) for name in items]
    scenes.activate(*(bpy.data.objects[name] for name in items), bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    assert len(bar.arapfields.carried) == len(items)
    scenes.activate(bar)

    assert bpy.ops.arapfields.live() == {"FINISHED"}
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    sessions.update(bpy.context, wait=30.0, refined=True)
    check(items, rest, 0.4, "live")
    bpy.ops.arapfields.live()
    check(items, rest, 0.0, "live mode ended")

    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.arapfields.deform(field="radial", samples=2000) == {"FINISHED"}
    bpy.ops.ed.undo_push(message="after")
    check(items, rest, 0.4, "deform")
    bpy.ops.ed.undo()
    check(items, rest, 0.0, "undo")
    bpy.ops.ed.redo()
    check(items, rest, 0.4, "redo")

    bar, moving = bpy.data.objects["Bar"], bpy.data.objects["Moving"]
    for frame, height in ((1, 0.0), (3, 0.4)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    folder = tempfile.mkdtemp()
    assert bpy.ops.arapfields.bake(format="PC2", start=1, end=3, folder=folder) == {"FINISHED"}
    for frame, shift in ((3, 0.4), (1, 0.0)):
        bpy.context.scene.frame_set(frame)
        check(items, rest, shift, f"bake, frame {frame}")
    render(3)
    bpy.ops.preferences.addon_disable(module=installed.MODULE)
    for frame, shift in ((1, 0.0), (3, 0.4)):
        bpy.context.scene.frame_set(frame)
        check(items, rest, shift, f"without the extension, frame {frame}")


def render(frame):
    """Renders one frame by Cycles; without a window Blender renders only if it finds libEGL."""
    if bpy.app.background and ctypes.util.find_library("EGL") is None:
        print("NOT RENDERED: no libEGL")
        return
    scene = bpy.context.scene
    seen = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(seen)
    seen.location, scene.camera = (0, 0, 6), seen
    scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "CYCLES", 32, 32
    scene.cycles.samples = 1
    scene.frame_start = scene.frame_end = frame
    scene.render.filepath = f"{tempfile.mkdtemp()}/"
    bpy.ops.render.render(animation=True)
    assert list(Path(scene.render.filepath).iterdir())


if __name__ == "__main__":
    sys.meta_path.insert(0, installed.FromTheExtension)
    import bpy

    installed.install(installed.arguments().zip)
    use()
    print(f"CARRIED {bpy.app.version_string}")
    sys.stdout.flush()
    if not hasattr(bpy.app, "module") and not bpy.app.binary_path:
        os._exit(0)  # see installed.py
