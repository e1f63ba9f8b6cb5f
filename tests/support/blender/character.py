# SPDX-License-Identifier: GPL-3.0-or-later
"""A character of several objects: body with Mirror and Subdivision, eyes, shirt, hair, hat, armature."""

import sys
from pathlib import Path
from types import SimpleNamespace

import bmesh
import bpy
import numpy as np
from mathutils import Matrix, Vector
from support.blender import scenes
from support.geometry.characters import Capsules

import arapfields as af

sys.path.append(str(Path(__file__).resolve().parents[3] / "blender_scripts"))
from people import link, rig, seen_mesh, strands, weigh

HEIGHT = 1.8
EYE, EYES = 0.032, [(side * 0.055, -0.118, 1.68) for side in (-1, 1)]
LOOSE = 0.02  # distance of the shirt from the skin
PARTS = [
    ((0, 0, 0.85), (0, 0, 1.28), 0.16),
    ((0, 0, 1.2), (0, 0, 1.55), 0.065),
    ((0, 0, 1.62), (0, 0, 1.7), 0.14),
]
for s in (-1, 1):
    PARTS += [
        ((s * 0.1, 0, 1.28), (s * 0.78, 0, 1.28), 0.055),
        ((s * 0.09, 0, 0.82), (s * 0.11, 0, 0.1), 0.08),
    ]
BONES = {  # name: parent, head, tail
    "Hips": (None, (0, 0, 0.8), (0, 0, 1.0)),
    "Chest": ("Hips", (0, 0, 1.0), (0, 0, 1.36)),
    "Neck": ("Chest", (0, 0, 1.36), (0, 0, 1.5)),
    "Head": ("Neck", (0, 0, 1.5), (0, 0, 1.85)),
}
for s, side in ((1, "L"), (-1, "R")):
    BONES[f"Upper Arm.{side}"] = ("Chest", (s * 0.17, 0, 1.28), (s * 0.45, 0, 1.28))
    BONES[f"Forearm.{side}"] = (f"Upper Arm.{side}", (s * 0.45, 0, 1.28), (s * 0.82, 0, 1.28))
    BONES[f"Leg.{side}"] = ("Hips", (s * 0.1, 0, 0.72), (s * 0.11, 0, 0.05))


def half_body():
    """The mesh of the half with x ≥ 0, open along the middle."""
    shape = Capsules(PARTS, af.Frame([0, 0, 0.9], 1.0))
    vertices, corners = af.extract_surface(shape, resolution=80)[:2]
    mesh = bpy.data.meshes.new("Body")
    edited = bmesh.new()
    points = [edited.verts.new(vertex) for vertex in vertices.tolist()]
    for corner in corners.tolist():
        edited.faces.new([points[i] for i in corner])
    cut = [*edited.verts, *edited.edges, *edited.faces]
    bmesh.ops.bisect_plane(edited, geom=cut, plane_co=(0, 0, 0), plane_no=(1, 0, 0), clear_inner=True)
    bmesh.ops.remove_doubles(edited, verts=edited.verts, dist=2e-3)
    for vertex in edited.verts:
        vertex.co.x = 0.0 if vertex.co.x < 2e-3 else vertex.co.x
    edited.to_mesh(mesh)
    edited.free()
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    return mesh


def shirt(body):
    points, normals, triangles = seen_mesh(body)
    inside = (points[:, 2] > 0.9) & (points[:, 2] < 1.37) & (np.abs(points[:, 0]) < 0.4)
    kept = triangles[inside[triangles].all(axis=1)]
    used, corners = np.unique(kept, return_inverse=True)
    mesh = bpy.data.meshes.new("Shirt")
    mesh.from_pydata((points + LOOSE * normals)[used].tolist(), [], corners.reshape(kept.shape).tolist())
    return link("Shirt", mesh)


def hat():
    """A cone on the head, bent by a lattice; (hat, lattice)."""
    bpy.ops.mesh.primitive_cone_add(vertices=24, radius1=0.17, depth=0.3, location=(0, 0.02, 1.93))
    item = bpy.context.object
    item.name = "Hat"
    cage = link("Hat Lattice", bpy.data.lattices.new("Hat Lattice"))
    cage.data.points_u = cage.data.points_v = cage.data.points_w = 3
    cage.location, cage.scale = (0, 0.02, 1.93), (0.4, 0.4, 0.4)
    for point in list(cage.data.points)[18:]:
        point.co_deform.y += 0.2
    item.modifiers.new("Lattice", "LATTICE").object = cage
    return item, cage


def build():
    """The character at rest in T-pose: its bones are handles of the body, which carries the other objects."""
    body = link("Body", half_body())
    person = SimpleNamespace(body=body, rig=rig(BONES))
    weigh(body, BONES)
    mirror = body.modifiers.new("Mirror", "MIRROR")
    mirror.use_clip = True
    body.modifiers.new("Armature", "ARMATURE").object = person.rig
    subdivision = body.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels = subdivision.render_levels = 1
    person.eyes = []
    for place, side in zip(EYES, "RL", strict=True):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=12, radius=EYE, location=place)
        bpy.context.object.name = f"Eye.{side}"
        person.eyes.append(bpy.context.object)
    person.shirt = shirt(body)
    person.hair = strands(body, lambda middles: (middles[:, 2] > 1.66) & (middles[:, 1] > -0.05))
    person.hat, person.cage = hat()
    scenes.activate(person.rig, body)
    bpy.ops.arapfields.add_bones()
    scenes.activate(*person.eyes, body)
    bpy.ops.arapfields.carry(way="RIGID")
    scenes.activate(person.shirt, person.hair, person.cage, body)
    bpy.ops.arapfields.carry(way="FOLLOW")
    scenes.activate(body)
    return person


def pose(person, neck=np.pi / 4, arm=np.pi / 3):
    """Turns the neck sideways, and raises the left arm."""
    for name, axis, angle in (("Neck", (0, 0, 1), neck), ("Upper Arm.L", (0, -1, 0), arm)):
        bone = person.rig.pose.bones[name]
        head = Matrix.Translation(bone.bone.head_local)
        turn = head @ Matrix.Rotation(angle, 4, Vector(axis)) @ head.inverted()
        bone.matrix = turn @ bone.bone.matrix_local
        bpy.context.view_layer.update()
