# SPDX-License-Identifier: GPL-3.0-or-later
"""A character: a child's body as one mesh, with a rig; eyes, shirt and hair are separate objects."""

import functools
import math
from types import SimpleNamespace

import bmesh
import bpy
import dressing
import numpy as np
import stage
from mathutils import Matrix
from shapes import Cone, Ellipsoid, build, mirrored, tube

SKIN, TROUSERS, SHOES = (0.70, 0.38, 0.24), (0.10, 0.13, 0.22), (0.30, 0.10, 0.05)
BONES = {
    "Hips": (None, (0, 0, 0.62), (0, 0, 0.82)),
    "Chest": ("Hips", (0, 0, 0.82), (0, 0, 1.14)),
    "Neck": ("Chest", (0, 0, 1.14), (0, 0, 1.28)),
    "Head": ("Neck", (0, 0, 1.28), (0, 0, 1.80)),
}
for s, side in ((1, "L"), (-1, "R")):
    BONES[f"Upper Arm.{side}"] = ("Chest", (s * 0.16, 0, 1.07), (s * 0.42, 0, 1.03))
    BONES[f"Forearm.{side}"] = (f"Upper Arm.{side}", (s * 0.42, 0, 1.03), (s * 0.72, 0, 0.98))
    BONES[f"Leg.{side}"] = ("Hips", (s * 0.12, 0, 0.56), (s * 0.13, 0, 0.05))
JOINTS = {
    name: bone for name, bone in BONES.items() if not name.startswith("Leg")
}  # knees, ankles, wrists as well
for s, side in ((1, "L"), (-1, "R")):
    JOINTS[f"Forearm.{side}"] = (f"Upper Arm.{side}", (s * 0.42, 0, 1.03), (s * 0.65, 0, 0.99))
    JOINTS[f"Hand.{side}"] = (f"Forearm.{side}", (s * 0.65, 0, 0.99), (s * 0.80, 0, 0.97))
    JOINTS[f"Thigh.{side}"] = ("Hips", (s * 0.11, 0, 0.58), (s * 0.125, 0, 0.32))
    JOINTS[f"Shin.{side}"] = (f"Thigh.{side}", (s * 0.125, 0, 0.32), (s * 0.13, 0, 0.09))
    JOINTS[f"Foot.{side}"] = (f"Shin.{side}", (s * 0.13, 0, 0.09), (s * 0.135, -0.18, 0.04))
EYE, EYES = 0.075, [(side * 0.125, -0.235, 1.545) for side in (-1, 1)]


@functools.cache
def body(cells=120):
    """The Shape: head, trunk, arms to the sides, legs; faces -y, 1.8 high."""
    middle = [
        Ellipsoid((0, 0.01, 1.52), (0.31, 0.29, 0.29)),
        Ellipsoid((0, -0.30, 1.45), (0.035, 0.04, 0.032), blend=0.03),
        Cone((0, 0.01, 1.1), (0, 0.01, 1.32), 0.085, 0.085, blend=0.05),
        *tube([(0, 0, 0.80), (0, 0, 0.90), (0, 0, 1.06)], [0.165, 0.165, 0.13]),
        *tube([(0, 0, 0.62), (0, 0, 0.70)], [0.185, 0.175], TROUSERS, blend=0.06),
    ]
    half = [
        *tube([(0.12, 0, 1.07), (0.42, 0, 1.03), (0.66, 0, 0.99)], [0.085, 0.066, 0.058], blend=0.07),
        Ellipsoid((0.74, -0.005, 0.975), (0.085, 0.05, 0.075), blend=0.04),
        Cone((0.70, -0.03, 0.99), (0.745, -0.085, 1.005), 0.03, 0.022, blend=0.03),
        Ellipsoid((0.305, 0.03, 1.50), (0.04, 0.055, 0.07), blend=0.03),
        *tube(
            [(0.10, 0, 0.58), (0.125, 0, 0.32), (0.13, 0, 0.12)], [0.115, 0.095, 0.085], TROUSERS, blend=0.06
        ),
        Ellipsoid((0.135, -0.06, 0.06), (0.085, 0.15, 0.065), SHOES, 0.03),
    ]
    mouth = [Ellipsoid((0, -0.285, 1.345), (0.06, 0.04, 0.012), (0.35, 0.06, 0.05))]
    return build([*middle, *mirrored(half)], 0.06, paint=mouth, base=SKIN, cells=cells)


def coloured(name, shape, roughness=0.45):
    """A smooth mesh object with vertex colours."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(shape.vertices.tolist(), [], shape.triangles.tolist())
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    attribute = mesh.color_attributes.new("colour", "FLOAT_COLOR", "POINT")
    rgba = np.c_[shape.colours, np.ones(len(shape.vertices))].astype(np.float32)
    attribute.data.foreach_set("color", rgba.ravel())
    mesh.materials.append(stage.vertex_paint(name, roughness))
    return dressing.link(name, mesh)


def shirt(skin, loose=0.028):
    """A shirt: trunk and upper arms, with straight edges, at a distance from the skin."""
    made = bmesh.new()
    made.from_mesh(skin.data)
    for place, out in (((0, 0, 0.66), (0, 0, -1)), ((0, 0, 1.165), (0, 0, 1))):
        cut(made, place, out)
    for side in (-1, 1):
        cut(made, (side * 0.40, 0, 1.03), (side, 0, 0))
    bmesh.ops.remove_doubles(made, verts=made.verts, dist=0.004)
    inner = [vertex for vertex in made.verts if not vertex.is_boundary]
    for _ in range(4):
        bmesh.ops.smooth_vert(
            made, verts=inner, factor=0.5, use_axis_x=True, use_axis_y=True, use_axis_z=True
        )
    made.normal_update()
    for vertex in made.verts:
        vertex.co += loose * vertex.normal
    mesh = bpy.data.meshes.new("Shirt")
    made.to_mesh(mesh)
    made.free()
    for name in [attribute.name for attribute in mesh.color_attributes]:
        mesh.color_attributes.remove(mesh.color_attributes[name])
    mesh.materials.clear()
    mesh.materials.append(stage.material("Shirt", (0.80, 0.20, 0.06), roughness=0.8))
    mesh.polygons.foreach_set("material_index", [0] * len(mesh.polygons))
    item = dressing.link("Shirt", mesh)
    item.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.012
    return item


def cut(made, place, out):
    """Removes the vertices on the outer side of a plane."""
    parts = [*made.verts, *made.edges, *made.faces]
    bmesh.ops.bisect_plane(made, geom=parts, plane_co=place, plane_no=out, clear_outer=True)


def split(item):
    """Separates the triangles, and keeps their shading."""
    normals = [tuple(vertex.normal) for vertex in item.data.vertices]
    corners = [normals[loop.vertex_index] for loop in item.data.loops]
    made = bmesh.new()
    made.from_mesh(item.data)
    bmesh.ops.split_edges(made, edges=made.edges)
    made.to_mesh(item.data)
    made.free()
    item.data.normals_split_custom_set(corners)


def eye(place, side):
    """A ball with its pupil towards -y."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=24, radius=EYE, location=place)
    item = bpy.context.object
    item.data.transform(Matrix.Rotation(math.radians(90), 4, "X"))  # poles in front and behind
    item.name = f"Eye.{side}"
    item.data.polygons.foreach_set("use_smooth", [True] * len(item.data.polygons))
    for name, colour in (("white", (0.9, 0.9, 0.88)), ("pupil", (0.02, 0.02, 0.03))):
        item.data.materials.append(stage.material(f"Eye {name}", colour, roughness=0.15))
    for polygon in item.data.polygons:
        polygon.material_index = int(polygon.center.normalized().y < -0.88)
    return item


def scalp(middles):
    """Whether hair grows on the triangles with these centers."""
    return (middles[:, 2] > 1.62 - 0.35 * np.maximum(middles[:, 1], 0)) & (middles[:, 1] > -0.19)


def build_scene():
    """The character at rest: body, rig, eyes, shirt, hair, without any bindings."""
    made = SimpleNamespace(body=coloured("Body", body()))
    made.rig = dressing.rig(BONES)
    dressing.weigh(made.body, BONES)
    made.body.modifiers.new("Armature", "ARMATURE").object = made.rig
    made.eyes = [eye(place, side) for place, side in zip(EYES, "RL", strict=True)]
    made.shirt = shirt(made.body)
    made.hair = dressing.strands(made.body, scalp, every=5, length=0.14, droop=2.0, steps=6, radius=0.011)
    made.hair.data.materials.append(stage.material("Hair", (0.10, 0.04, 0.015), roughness=0.5))
    return made


def near(points, place, radii):
    """(n,) weights of points: 1 at `place`, decreasing with the distance."""
    return np.exp(-(((points - place) / radii) ** 2).sum(axis=1))[:, None]


def add_keys(item):
    """Shape keys of the body: a long nose, pointed ears."""
    rest = np.array([vertex.co for vertex in item.data.vertices])
    nose = near(rest, (0, -0.31, 1.45), 0.055) * (0, -0.26, 0.03)
    ears = sum(
        near(rest, (side * 0.32, 0.03, 1.52), (0.05, 0.06, 0.08)) * (side * 0.18, 0.04, 0.12)
        for side in (-1, 1)
    )
    item.shape_key_add(name="Basis")
    for name, way in (("Nose", nose), ("Ears", ears)):
        key = item.shape_key_add(name=name, from_mix=False)
        key.data.foreach_set("co", (rest + way).astype(np.float32).ravel())


def rigged():
    """[body, shirt, eyes], each with weights of one rig; the body has shape keys."""
    whole, bones = coloured("Child", body(cells=100)), dressing.rig(BONES)
    shirt(whole).modifiers.clear()
    items = [whole, bpy.data.objects["Shirt"]]
    items += [eye(place, side) for place, side in zip(EYES, "RL", strict=True)]
    for item in items:
        item.data.transform(item.matrix_basis)
        item.matrix_basis.identity()
        dressing.weigh(item, BONES)
        item.modifiers.new("Armature", "ARMATURE").object = bones
    add_keys(whole)
    return items
