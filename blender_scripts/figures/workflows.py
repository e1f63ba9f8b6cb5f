# SPDX-License-Identifier: GPL-3.0-or-later
"""The ends of the workflow pages: what each page's own script leaves of its example, rendered."""

import os
import re
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
import stage

from .common import stack

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs" / "workflows"
BLOCK = re.compile(r"^```python\n(.*?)^```", re.S | re.M)


def extension():
    """The add-on of this repository, registered."""
    sys.path[:0] = [str(ROOT)]
    import addon

    if not hasattr(bpy.types.Object, "arapfields"):
        addon.register()


def in_examples(call):
    """Calls it in an empty folder that has out/examples."""
    import examples

    extension()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        os.environ["PWD"] = os.getcwd()  # what Blender takes for the folder it is in
        examples.write(Path("out/examples"))
        return call()


def followed(page):
    """Runs the page's script; its names."""
    names = {}
    for code in BLOCK.findall((PAGES / f"{page}.md").read_text()):
        exec(compile(code, f"{page}.md", "exec"), names)
    return names


def snapshot(path, width=960, samples=8):
    render = bpy.context.scene.render
    bpy.context.scene.cycles.samples = 6 if stage.DRAFT else samples
    render.resolution_percentage = round(100 * width / render.resolution_x * (0.4 if stage.DRAFT else 1))
    stage.take(path)
    return path


def moved(name):
    """How far the object's points went, largest, of its size."""
    item = bpy.data.objects[name]
    seen = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    rest, now = (np.array([vertex.co for vertex in mesh.vertices]) for mesh in (item.data, seen))
    return round(float(np.linalg.norm(now - rest, axis=1).max() / np.linalg.norm(np.ptp(rest, axis=0))), 3)


def pins(output):
    followed("pins")
    snapshot(output / "workflow-pins.png", 640)
    return {"moved": moved("Dinosaur")}


def character(output):
    bpy.ops.wm.open_mainfile(filepath="out/examples/character.blend")
    rest = snapshot(output / "character-rest.png", 480)
    followed("character")
    end = snapshot(output / "character-end.png", 480)
    stack([rest, end], output / "workflow-character.png", gap=0, horizontal=True)
    return {"moved": moved("Body")}


def animate(output, frames=(1, 9, 17, 25)):
    followed("animate")
    paths, far = [], 0.0
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        paths.append(snapshot(output / f"animate-{frame}.png", 360))
        far = max(far, moved("Dinosaur"))
    stack(paths, output / "workflow-animate.png", gap=0, horizontal=True)
    return {"moved": far}


def stylize(output):
    bpy.ops.wm.open_mainfile(filepath="out/examples/stylize.blend")
    paths = [snapshot(output / "stylize-rest.png", 400)]
    followed("stylize")
    paths.append(snapshot(output / "stylize-cube.png", 400))
    result = {"moved": moved("Dog")}
    bpy.ops.arapfields.stylize(style="ICOSAHEDRON")
    paths.append(snapshot(output / "stylize-icosahedron.png", 400))
    stack(paths, output / "workflow-stylize.png", gap=0, horizontal=True)
    return result


def render(output):
    output = output.resolve()
    return in_examples(lambda: {call.__name__: call(output) for call in (pins, character, animate, stylize)})
