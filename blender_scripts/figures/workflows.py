# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the workflow pages, by the pages' own scripts, and of a wrap."""

import json
import os
import re
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
import people
import stage
from mathutils import Matrix, Vector

from .common import stack

# The ends of the workflow pages: what each page's own script leaves of its example, rendered.

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


def draw_workflows(output):
    output = output.resolve()
    return in_examples(lambda: {call.__name__: call(output) for call in (pins, character, animate, stylize)})


# A rigged, coloured child wrapped onto the scan of a grown-up, bones included, and posed by its own rig.

SPACING = 1.75
BONE = (0.02, 0.12, 0.55)


def scan():
    """Its triangles, loose, noisy, with holes."""
    shape, rng = people.adult_body(), np.random.default_rng(0)
    kept = shape.triangles[rng.random(len(shape.triangles)) > 0.04]
    corners = (shape.vertices[kept] + rng.normal(0, 0.002, (len(kept), 1, 3))).reshape(-1, 3)
    mesh = bpy.data.meshes.new("Scan")
    mesh.from_pydata(corners.tolist(), [], np.arange(len(corners)).reshape(-1, 3).tolist())
    mesh.materials.append(stage.material("Scan", stage.CLAY))
    return people.link("Scan", mesh)


def bones_of(rig):
    """[(head, tail)] in the world, as they are posed."""
    return [(rig.matrix_world @ bone.head, rig.matrix_world @ bone.tail) for bone in rig.pose.bones]


def as_seen(name, item, rig, column):
    """What is shown of a body now, half transparent, and its bones."""
    seen = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = bpy.data.meshes.new_from_object(seen)
    paint = stage.vertex_paint(name)
    paint.node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = 0.6
    mesh.materials.clear()
    mesh.materials.append(paint)
    shown = [people.link(name, mesh)]
    for head, tail in bones_of(rig):
        way = tail - head
        bpy.ops.mesh.primitive_cone_add(vertices=4, radius1=0.1 * way.length, radius2=0, depth=way.length)
        bone = bpy.context.object
        bone.matrix_world = (
            Matrix.Translation((head + tail) / 2) @ way.to_track_quat("Z", "Y").to_matrix().to_4x4()
        )
        bone.data.materials.append(stage.material("Bone", BONE))
        shown.append(bone)
    for one in shown:
        one.matrix_world = Matrix.Translation((column * SPACING, 0, 0)) @ one.matrix_world
    return shown


def pose(rig):
    for name, axis, angle in (
        ("Upper Arm.L", (0, -1, 0), 1.5),
        ("Forearm.L", (0, -1, 0), 0.5),
        ("Upper Arm.R", (0, 1, 0), -0.3),
        ("Leg.R", (1, 0, 0), 0.5),
        ("Neck", (0, 0, 1), 0.5),
    ):
        bone = rig.pose.bones[name]
        head = Matrix.Translation(bone.head)
        bone.matrix = head @ Matrix.Rotation(angle, 4, Vector(axis)) @ head.inverted() @ bone.matrix
        bpy.context.view_layer.update()


def draw_wrapping(output):
    extension()
    stage.clear()
    body, rig = people.coloured("Body", people.body()), people.rig(people.BONES)
    people.weigh(body, people.BONES)
    body.modifiers.new("Armature", "ARMATURE").object = rig
    target = scan()
    body.arapfields.wrap.onto = target
    bpy.context.view_layer.objects.active = body
    body.select_set(True)
    bpy.context.view_layer.update()
    for rest, there in people.PAIRS:
        bpy.ops.arapfields.add_landmark(rest=rest, on_target=there)
    shown = as_seen("Template", body, rig, 0)
    bpy.context.view_layer.objects.active = body
    bpy.ops.arapfields.wrap()
    report = json.loads(body["arapfields_report"])
    shown += as_seen("Wrapped", body, rig, 2)
    pose(rig)
    shown += as_seen("Posed", body, rig, 3)
    target.matrix_world = Matrix.Translation((SPACING, 0, 0))
    for item in (body, rig, *(o for o in bpy.data.objects if o.type == "EMPTY")):
        item.hide_render = True
    stage.photograph([*shown, target], output / "wrapping.png", width=1200, elevation=4)
    return {name: round(100 * report[name], 3) for name in ("to_target_mean", "from_target_mean")}
