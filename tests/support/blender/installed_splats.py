# SPDX-License-Identifier: GPL-3.0-or-later
"""Script for a separate Blender with splats of its own: the extension from a zip poses a cloud that Blender's
own importer read, by a solve and live; the posed cloud is rendered, saved, reopened, written, imported again.

python installed_splats.py ZIP FOLDER
"""

import importlib
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from support.blender import installed

SAME = 1e-5  # of what is written and imported again: the centers' largest difference
NEAR = 0.12  # see installed_carried.py
DECIBELS = 40  # of renders of the posed cloud and of what was written of it


def imported(path):
    bpy.ops.wm.ply_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    item = bpy.context.object
    assert (item.type, item.data.type) == ("POINTCLOUD", "GAUSSIAN_SPLAT")
    return item


def shown(item):
    """{attribute: values} of the evaluated cloud."""
    import numpy as np

    bpy.context.view_layer.update()
    data, found = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data, {}
    sizes = {"position": 3, "rotation": 4, "scale": 3, "radiance:base": 4, "radiance:sh_0": 3}
    for name, width in sizes.items():
        attribute = data.attributes[name]
        flat = np.empty(width * len(attribute.data), np.float32)
        attribute.data.foreach_get("value" if attribute.data_type == "QUATERNION" else "vector", flat)
        found[name] = flat.reshape(-1, width)
    return found


def gap(one, other):
    import numpy as np

    return max(float(np.abs(one[name] - other[name]).max()) for name in one)


def rendered(path):
    """(h, w, 3) of the scene as Cycles sees it, and a picture in `path`."""
    import numpy as np

    scene = bpy.context.scene
    if scene.camera is None:
        scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        scene.collection.objects.link(scene.camera)
        scene.camera.location, scene.camera.rotation_euler = (0, -4.5, 0.2), (np.pi / 2, 0, 0)
        scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 64, False
        scene.render.resolution_x, scene.render.resolution_y = 240, 160
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(str(path))
    flat = np.empty(len(picture.pixels), np.float32)
    picture.pixels.foreach_get(flat)
    bpy.data.images.remove(picture)
    return flat.reshape(160, 240, -1)[..., :3]


def decibels(one, other):
    import numpy as np

    return float(-10 * np.log10(max(np.mean((one - other) ** 2), 1e-12)))


def use(folder):
    import numpy as np
    from support.blender import scans, scenes

    sessions = importlib.import_module(f"{installed.MODULE}.live.sessions")
    bpy.ops.wm.read_homefile(use_empty=True)
    scans.given(2000, 4).save(folder / "bar.ply")
    item = imported(folder / "bar.ply")
    item.name = "Scan"
    rest = shown(item)
    fixed = scenes.cube_empty((-0.9, 0, 0), (0.15, 0.4, 0.4), "Fixed")
    moving = scenes.cube_empty((0.9, 0, 0), (0.15, 0.4, 0.4), "Moving")
    bpy.context.view_layer.update()
    scenes.activate(fixed, moving, item)
    assert bpy.ops.arapfields.add_handle() == {"FINISHED"}
    scenes.activate(item)
    held = [rest["position"][:, 0] < -0.85, rest["position"][:, 0] > 0.85]

    def check(what, by):
        moved = shown(item)["position"] - rest["position"]
        assert np.abs(moved[held[0]]).max() < NEAR, (what, "fixed")
        assert np.abs(moved[held[1]] - [0, 0, by]).max() < NEAR, (what, "moving")

    moving.location.z += 0.4
    assert bpy.ops.arapfields.deform(samples=2000) == {"FINISHED"}
    check("solved", 0.4)
    assert bpy.ops.arapfields.remove_field() == {"FINISHED"}
    assert gap(shown(item), rest) == 0
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    for height in (0.2, 0.5):
        moving.location.z = height
        bpy.context.view_layer.update()
        sessions.update(bpy.context, wait=60.0, refined=True)
        check("live", height)
    scenes.activate(item)
    assert bpy.ops.arapfields.live_keep() == {"FINISHED"}
    posed = shown(item)
    check("kept", 0.5)

    before = rendered(folder / "posed.png")
    assert before.std() > 0.02, before.std()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scan.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "scan.blend"))
    item = bpy.data.objects["Scan"]
    assert gap(shown(item), posed) == 0
    reopened = decibels(rendered(folder / "reopened.png"), before)
    scenes.activate(item)
    seen = {"reopened": reopened}
    for suffix in ("ply", "glb"):
        path = folder / f"written.{suffix}"
        scenes.activate(item)
        assert bpy.ops.arapfields.export_splats(filepath=str(path)) == {"FINISHED"}
        if suffix == "ply":
            again = imported(path)
        else:
            bpy.ops.import_scene.gltf(filepath=str(path))
            again = bpy.context.object
        assert gap(shown(again), posed) < SAME, gap(shown(again), posed)
        item.hide_render = True
        seen[suffix] = decibels(rendered(folder / f"{suffix}.png"), before)
        item.hide_render = False
        bpy.data.objects.remove(again)
    print({name: round(value, 1) for name, value in seen.items()})
    assert min(seen.values()) > DECIBELS, seen


if __name__ == "__main__":
    sys.meta_path.insert(0, installed.FromTheExtension)
    import bpy

    installed.install(sys.argv[1])
    use(Path(sys.argv[2]))
    print(f"POSED {bpy.app.version_string}")
    sys.stdout.flush()
    os._exit(0)  # see installed.py
