# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects to wrap onto each other."""

import bpy
import numpy as np
import scenes

SMALL = {"centers": 50, "stages": 3, "iterations": 10, "samples": 1500}


def bar_and_target():
    """A decorated bar, and beside it a thicker, turned one: a scan of a kind."""
    target = scenes.bar("Scan")
    target.location, target.rotation_euler, target.scale = (3, 1, 0), (0, 0, 0.5), (1.5, 1.8, 1.4)
    item = scenes.bar()
    scenes.decorate(item)
    item.arapfields.wrap.onto = target
    bpy.context.view_layer.update()
    return item, target


def rigged_bar():
    """(bar, armature): a decorated bar with a shape key, posed by two bones along it."""
    item = scenes.decorate(scenes.bar())
    item.shape_key_add(name="Basis")
    for point in item.shape_key_add(name="Fat").data:
        point.co.y *= 1.5
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(rig)
    scenes.activate(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    lower, upper = (rig.data.edit_bones.new(name) for name in ("Lower", "Upper"))
    lower.head, lower.tail, upper.head, upper.tail = (-0.9, 0, 0), (0, 0, 0), (0, 0, 0), (0.9, 0, 0)
    upper.parent = lower
    bpy.ops.object.mode_set(mode="OBJECT")
    for name, side in (("Lower", -1), ("Upper", 1)):
        group = item.vertex_groups.new(name=name)
        for vertex in item.data.vertices:
            group.add([vertex.index], min(max(0.5 + side * 2 * vertex.co.x, 0), 1), "REPLACE")
    item.modifiers.new("Armature", "ARMATURE").object = rig
    scenes.activate(item)
    return item, rig


def soup_of(item):
    """Loose triangles of a thicker, bent bar elsewhere, noisy and with holes, as of a scan."""
    rng = np.random.default_rng(0)
    item.data.calc_loop_triangles()
    points = scenes.world_points(item)[[t.vertices for t in item.data.loop_triangles]].reshape(-1, 3)
    x, y, z = (points * [1.3, 1.5, 1.4]).T
    bent = np.stack([np.cos(0.2 * x) * x + 0.5, y + 0.2 * x * x + 3, z + 0.3], 1)
    bent = bent.reshape(-1, 3, 3)[rng.random(len(bent) // 3) > 0.05].reshape(-1, 3)
    bent += rng.normal(0, 0.004, bent.shape)
    mesh = bpy.data.meshes.new("Soup")
    mesh.from_pydata(bent.tolist(), [], np.arange(len(bent)).reshape(-1, 3).tolist())
    soup = bpy.data.objects.new("Soup", mesh)
    bpy.context.collection.objects.link(soup)
    bpy.context.view_layer.update()
    scenes.activate(item)
    return soup
