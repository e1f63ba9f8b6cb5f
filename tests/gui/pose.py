# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses a dog with the pin tool by five clicks and drags, with a picture after each.

python tests/gui/pose.py DOG.npz writes the dog's mesh (it needs scikit-image);
blender --factory-startup --python tests/gui/window.py -- OUTPUT_FOLDER pose=DOG.npz poses it, by xdotool.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# (action, point at rest (x, y, z), motion to the right and up).
ACTIONS = (  # as in docs/guide/pins.md
    ("anchor", (0.17, 0.46, 0.10), None),  # a hind paw
    ("anchor", (-0.17, 0.46, 0.10), None),
    ("anchor", (-0.17, -0.46, 0.10), None),
    ("drag", (0.17, -0.46, 0.16), (-0.30, 0.38)),  # gives the paw
    ("drag", (0.10, -0.70, 1.24), (0.06, 0.16)),  # lifts the head
)


def write(path):
    import numpy as np

    sys.path[:0] = [str(ROOT / "blender_scripts")]
    from creatures import dog

    shape = dog()
    np.savez(path, vertices=shape.vertices, triangles=shape.triangles, colours=shape.colours)


def load(path):
    """Adds the dog, rotated as by importers, with vertex groups of its parts."""
    import bpy
    import numpy as np

    data = np.load(path)
    mesh = bpy.data.meshes.new("Dog")
    x, y, z = data["vertices"].T
    mesh.from_pydata(np.stack([x, z, -y], axis=1).tolist(), [], data["triangles"].tolist())
    mesh.shade_smooth()
    colours = mesh.color_attributes.new("Colour", "FLOAT_COLOR", "POINT")
    colours.data.foreach_set("color", np.c_[data["colours"], np.ones(len(data["vertices"]))].ravel())
    dog = bpy.data.objects.new("Dog", mesh)
    dog.rotation_euler.x = np.pi / 2
    bpy.context.collection.objects.link(dog)
    parts = {"head": lambda x, y, z: (z > 0.98) & (y < -0.3), "tail": lambda x, y, z: (y > 0.45) & (z > 0.85)}
    parts |= {"paw L": lambda x, y, z: (z < 0.25) & (y < 0) & (x > 0)}
    for name, inside in parts.items():
        chosen = np.flatnonzero(inside(*data["vertices"].T))
        dog.vertex_groups.new(name=name).add(chosen.tolist(), 1.0, "REPLACE")
    return dog


def checks(path, figures, folder):
    import bpy
    import mouse
    import numpy as np
    import stage
    from support.blender import scenes

    stage.empty_file()
    with stage.override():
        dog = load(path)
        scenes.activate(dog)
        bpy.context.space_data.show_region_ui = False
        bpy.context.space_data.shading.color_type = "VERTEX"
        bpy.ops.view3d.view_axis(type="RIGHT")
        bpy.ops.view3d.view_orbit(angle=0.6, type="ORBITLEFT")
        bpy.ops.view3d.view_orbit(angle=0.3, type="ORBITUP")
        bpy.ops.view3d.view_all()
        bpy.ops.arapfields.pin_tool("INVOKE_DEFAULT")
        bpy.ops.ed.undo_push(message="stage")
    yield 1.0
    rest = scenes.world_points(dog)
    stage.picture(folder, "pose-0")
    for number, (kind, where, by) in enumerate(ACTIONS, 1):
        now = scenes.world_points(dog)[np.linalg.norm(rest - where, axis=1).argmin()]
        if kind == "anchor":
            yield from mouse.hover(mouse.pixel(now))
            stage.tool("keydown", "shift")
            yield 0.2
            stage.tool("click", 1)
            yield from mouse.until(lambda count=number: len(dog.arapfields.handles) == count, 5.0)
            stage.tool("keyup", "shift")
        else:
            yield from mouse.drag(mouse.pixel(now), mouse.pixel(np.add(now, (0, *by))))
        yield 0.3
        stage.picture(folder, f"pose-{number}")
    figures["anchors"] = [entry.anchor for entry in dog.arapfields.handles]
    figures.update(judged(rest, scenes.world_points(dog)))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "pose.blend"))


def judged(rest, now):
    """Measures of the pose's quality, of (n, 3) points at rest and now."""
    import numpy as np

    from addon.core.geometry.rotations import best_rotation

    away, height = np.linalg.norm(now - rest, axis=1), np.ptp(rest[:, 2])
    _, y, z = rest.T
    parts = {"trunk": (z > 0.55) & (z < 1.0) & (np.abs(y) < 0.35), "hind": (y > 0.3) & (z < 0.12)}
    parts["hoof"] = np.linalg.norm(rest - ACTIONS[3][1], axis=1) < 0.12
    turn = best_rotation(rest[parts["hoof"]], now[parts["hoof"]])
    return {
        "trunk_moved": round(float(away[parts["trunk"]].mean() / height), 4),
        "feet_moved": round(float(away[parts["hind"]].mean() / height), 4),
        "hoof_hangs_degrees": round(float(np.degrees(np.arccos((np.trace(turn) - 1) / 2))), 1),
    }


if __name__ == "__main__":
    write(sys.argv[1])
