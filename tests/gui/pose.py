# SPDX-License-Identifier: GPL-3.0-or-later
"""A dog of our own is posed with the pin tool, by seven clicks and drags; a picture after each.

python tests/gui/pose.py DOG.npz writes the dog's mesh (it needs scikit-image);
blender --factory-startup --python tests/gui/window.py -- OUTPUT_FOLDER pose=DOG.npz poses it, by xdotool.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# What is done, where (x, y, z at rest; the ray may meet the dog before it), and by how much across and up.
ACTIONS = (
    ("anchor", (0.17, 0.46, 0.10), None),  # the hind paw
    ("anchor", (0.20, 0.35, 0.66), None),  # the hip
    ("drag", (0.17, -0.46, 0.10), (-0.42, 0.42)),  # gives the paw
    ("drag", (0.10, -0.70, 1.24), (0.10, 0.16)),  # lifts the head
    ("turn", 3, 25.0),  # and the nose
    ("drag", (0.05, 0.70, 1.20), (0.26, 0.05)),  # the tail
    ("drag", (0.20, -0.58, 1.50), (-0.02, 0.10)),  # pricks an ear
)


def write(path):
    import numpy as np

    sys.path[:0] = [str(ROOT / "blender_scripts")]
    from creatures import dog

    shape = dog()
    np.savez(path, vertices=shape.vertices, triangles=shape.triangles, colours=shape.colours)


def load(path):
    """The dog in the scene, with vertex groups that name its parts."""
    import bpy
    import numpy as np

    data = np.load(path)
    mesh = bpy.data.meshes.new("Dog")
    mesh.from_pydata(data["vertices"].tolist(), [], data["triangles"].tolist())
    mesh.shade_smooth()
    colours = mesh.color_attributes.new("Colour", "FLOAT_COLOR", "POINT")
    colours.data.foreach_set("color", np.c_[data["colours"], np.ones(len(data["vertices"]))].ravel())
    dog = bpy.data.objects.new("Dog", mesh)
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
        bpy.ops.view3d.view_all()
        bpy.ops.arapfields.pin_tool("INVOKE_DEFAULT")
        bpy.ops.ed.undo_push(message="stage")
    yield 1.0
    rest = scenes.world_points(dog)
    stage.picture(folder, "pose-0")
    for number, (kind, where, by) in enumerate(ACTIONS, 1):
        if kind == "turn":
            empty = dog.arapfields.handles[where].empty
            x, y = mouse.pixel(empty.location)
            start = (x - 46, y)
            angle = np.radians(by)
            end = (round(x - 46 * np.cos(angle)), round(y - 46 * np.sin(angle)))
            yield from mouse.drag(start, end)
        else:
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
    figures["names"] = [entry.empty.name for entry in dog.arapfields.handles]
    figures["anchors"] = [entry.anchor for entry in dog.arapfields.handles]
    figures["moved"] = round(float(np.linalg.norm(scenes.world_points(dog) - rest, axis=1).max()), 3)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "pose.blend"))


if __name__ == "__main__":
    write(sys.argv[1])
