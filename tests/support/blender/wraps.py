# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects to wrap, and targets."""

import bpy
import numpy as np
from support.blender import character, scenes
from support.blender.character import link, rig, weigh
from support.geometry.characters import Capsules

import arapfields as af
from addon.blender import mesh_arrays

SMALL = {"centers": 50, "stages": 3, "iterations": 6, "samples": 1000}


def bar_and_target():
    """(decorated bar, target): the target is a thicker, rotated bar beside it."""
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
    """An object like a scan: loose, noisy triangles with holes, of a thicker, bent bar elsewhere."""
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


def scan_of(parts, noise=0.004, resolution=64, lost=0.03):
    """Loose, noisy triangles with holes of a body of capsules."""
    shape = Capsules(parts, af.Frame([0, 0, 1.0], 1.25))
    vertices, triangles = af.extract_surface(shape, resolution=resolution)[:2]
    rng = np.random.default_rng(0)
    corners = vertices[triangles[rng.random(len(triangles)) > lost]]
    corners = (corners + rng.normal(0, noise / 2, (len(corners), 1, 3))).reshape(-1, 3)
    mesh = bpy.data.meshes.new("Scan")
    mesh.from_pydata(corners.tolist(), [], np.arange(len(corners)).reshape(-1, 3).tolist())
    return link("Scan", mesh), Capsules(parts, shape.frame)


def rigged_character():
    """(body, armature): the character's body, textured, with a shape key."""
    body, armature = link("Body", character.half_body()), rig(character.BONES)
    points = np.array([vertex.co for vertex in body.data.vertices])
    uv = body.data.uv_layers.new(name="UV")
    corners = np.array([loop.vertex_index for loop in body.data.loops])
    uv.data.foreach_set("uv", points[corners][:, [0, 2]].astype(np.float32).ravel())
    weigh(body, character.BONES)
    body.shape_key_add(name="Basis")
    belly = body.shape_key_add(name="Belly")
    for point, place in zip(belly.data, points, strict=True):
        point.co.y -= 0.1 * np.exp(-20 * ((place - [0, -0.16, 1.0]) ** 2).sum())
    body.modifiers.new("Mirror", "MIRROR").use_clip = True
    body.modifiers.new("Armature", "ARMATURE").object = armature
    scenes.activate(body)
    return body, armature


def grown_parts():
    """The character's capsules in other proportions: longer legs, shorter, hanging arms, a thicker trunk."""
    parts = [
        ((0, 0, 1.0), (0, 0, 1.38), 0.21),
        ((0, 0.02, 1.35), (0, 0, 1.72), 0.075),
        ((0, -0.02, 1.79), (0, -0.02, 1.89), 0.15),
    ]
    for s in (-1, 1):
        parts += [
            ((s * 0.13, 0, 1.42), (s * 0.4, 0.02, 1.28), 0.07),
            ((s * 0.4, 0.02, 1.28), (s * 0.64, -0.1, 1.1), 0.065),
            ((s * 0.11, 0, 0.95), (s * 0.2, 0.03, 0.1), 0.095),
        ]
    return parts


ENDS = {  # points of the character and of grown_parts: crown, hands, feet
    "crown": ((0, 0, 1.84), (0, -0.02, 2.04)),
    "hand": ((0.835, 0, 1.28), (0.70, -0.14, 1.06)),
    "foot": ((0.11, 0, 0.02), (0.2, 0.03, 0.005)),
}


def landmarks_of_people():
    pairs = [ENDS["crown"]]
    for rest, there in (ENDS["hand"], ENDS["foot"]):
        pairs += [((s * rest[0], *rest[1:]), (s * there[0], *there[1:])) for s in (-1, 1)]
    return pairs


def joints(armature, posed):
    """(k, 3) heads and tails of the bones in world space, at rest or posed."""
    bones = armature.pose.bones
    ends = [(b.head, b.tail) if posed else (b.bone.head_local, b.bone.tail_local) for b in bones]
    return np.array([armature.matrix_world @ end for pair in ends for end in pair])


def offsets(item, name):
    """(n, 3) offsets of a shape key from the key that it is relative to."""
    block = item.data.shape_keys.key_blocks[name]
    places = [mesh_arrays.vectors(key.data, "co").astype(float) for key in (block, block.relative_key)]
    return places[0] - places[1]
