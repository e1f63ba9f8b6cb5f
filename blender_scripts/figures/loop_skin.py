# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose of the skin page by Blender's automatic weights, triangles apart and welded, and by the page."""

import bpy
import numpy as np

from .common import stack
from .looping import film
from .workflows import followed, in_examples, snapshot

SCENE, WIDTH = "out/examples/skin.blend", 320


def pose(turns, share=1.0):
    for name, turn in turns.items():
        bpy.data.objects["Rig"].pose.bones[name].rotation_euler = [share * angle for angle in turn]


def automatic(weld):
    """The scene with Blender's weights."""
    bpy.ops.wm.open_mainfile(filepath=SCENE)
    body, rig = bpy.data.objects["Body"], bpy.data.objects["Rig"]
    if weld:
        body.modifiers.new("Weld", "WELD").merge_threshold = 1e-5
        bpy.ops.object.modifier_apply(modifier="Weld")
    bpy.ops.object.select_all(action="DESELECT")
    for item in (*(item for item in bpy.data.objects if item.type == "MESH"), rig):
        item.select_set(item.users_collection[0].name != "Studio")
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")


def points():
    body = bpy.data.objects["Body"]
    seen = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return [np.array([vertex.co for vertex in mesh.vertices]) for mesh in (body.data, seen)]


def gap():
    """How far corners that are one at rest are apart in the pose, most, as a share of the height."""
    rest, now = points()
    _, same = np.unique(rest.round(5), axis=0, return_inverse=True)
    same = same.ravel()
    low, high = np.full((same.max() + 1, 3), np.inf), np.full((same.max() + 1, 3), -np.inf)
    np.minimum.at(low, same, now)
    np.maximum.at(high, same, now)
    return round(float(np.linalg.norm(high - low, axis=1).max() / np.ptp(rest[:, 2])), 6)


def draw(output):
    bpy.ops.wm.open_mainfile(filepath=SCENE)
    paths, gaps = [snapshot(output / "rest.png", WIDTH)], {}
    turns = {name: tuple(turn) for name, turn in followed("skin")["radians"].items()}
    gaps["ours"] = gap()
    ours = snapshot(output / "ours.png", WIDTH)
    measured = film(output, "loop-skin", lambda share: pose(turns, share), width=400)
    for name, weld in (("apart", False), ("welded", True)):
        automatic(weld)
        pose(turns)
        bpy.context.view_layer.update()
        gaps[name] = gap()
        paths.append(snapshot(output / f"{name}.png", WIDTH))
    stack([*paths, ours], output / "workflow-skin.png", gap=0, horizontal=True)
    return {**measured, "gaps": gaps}


def render(output):
    return in_examples(lambda: draw(output.resolve()))
