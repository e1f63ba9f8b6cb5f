# SPDX-License-Identifier: GPL-3.0-or-later
"""A child with clothes, hair and bones, and a grown-up: bodies, rigs and what is worn."""

import functools
import math
from types import SimpleNamespace

import bmesh
import bpy
import numpy as np
import stage
from mathutils import Matrix, Vector
from shapes import Cone, Ellipsoid, build, mirrored, tube

# Rig, weights and hair of characters. Bones are {name: (parent, head, tail)}.


def link(name, data):
    item = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(item)
    return item


def rig(bones, name="Rig"):
    item = link(name, bpy.data.armatures.new(name))
    bpy.context.view_layer.objects.active = item
    bpy.ops.object.mode_set(mode="EDIT")
    for bone_name, (parent, head, tail) in bones.items():
        bone = item.data.edit_bones.new(bone_name)
        bone.head, bone.tail = head, tail
        if parent:
            bone.parent = item.data.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in item.pose.bones:
        bone.rotation_mode = "XYZ"
    return item


def weigh(item, bones, blend=0.04):
    """Adds vertex groups of the bones, blended where two are about equally near."""
    points = np.array([vertex.co for vertex in item.data.vertices])
    away = []
    for _, head, tail in bones.values():
        head, way = np.array(head), np.array(tail) - head
        share = np.clip((points - head) @ way / (way @ way), 0, 1)
        away.append(np.linalg.norm(points - head - share[:, None] * way, axis=1))
    weights = np.exp(-((np.array(away) - np.min(away, axis=0)) / blend))
    weights /= weights.sum(axis=0)
    for name, row in zip(bones, weights, strict=True):
        group = item.vertex_groups.new(name=name)
        for index in np.flatnonzero(row > 0.02).tolist():
            group.add([index], float(row[index]), "REPLACE")


def seen_mesh(item):
    """((n, 3) evaluated vertices in world space, their normals, triangles) of an object."""
    bpy.context.view_layer.update()
    seen = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh, world = seen.to_mesh(), np.array(seen.matrix_world)
    mesh.calc_loop_triangles()
    points = np.array([vertex.co for vertex in mesh.vertices]) @ world[:3, :3].T + world[:3, 3]
    normals = np.array([vertex.normal for vertex in mesh.vertices]) @ world[:3, :3].T
    triangles = np.array([triangle.vertices for triangle in mesh.loop_triangles])
    seen.to_mesh_clear()
    return points, normals, triangles


def strands(body, chosen, every=7, length=0.12, droop=3.0, steps=6, radius=None):
    """Hair curves from every `every`-th of the triangles whose centers (n, 3) are chosen."""
    points, normals, triangles = seen_mesh(body)
    middles, out = points[triangles].mean(axis=1), normals[triangles].mean(axis=1)
    rows = np.flatnonzero(chosen(middles))[::every]
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([steps] * len(rows))
    along = np.linspace(0, length, steps)[:, None]
    places = [middles[row] + along * out[row] - [0, 0, 1] * along**2 * droop for row in rows]
    curves.attributes["position"].data.foreach_set(
        "vector", np.concatenate(places).astype(np.float32).ravel()
    )
    if radius:
        thin = np.tile(np.linspace(radius, 0.3 * radius, steps, dtype=np.float32), len(rows))
        curves.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", thin)
    return link("Hair", curves)


# A character: a child's body as one mesh, with a rig; eyes, shirt and hair are separate objects.

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
    return link(name, mesh)


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
    item = link("Shirt", mesh)
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
    made.rig = rig(BONES)
    weigh(made.body, BONES)
    made.body.modifiers.new("Armature", "ARMATURE").object = made.rig
    made.eyes = [eye(place, side) for place, side in zip(EYES, "RL", strict=True)]
    made.shirt = shirt(made.body)
    made.hair = strands(made.body, scalp, every=5, length=0.14, droop=2.0, steps=6, radius=0.011)
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
    whole, bones = coloured("Child", body(cells=100)), rig(BONES)
    shirt(whole).modifiers.clear()
    items = [whole, bpy.data.objects["Shirt"]]
    items += [eye(place, side) for place, side in zip(EYES, "RL", strict=True)]
    for item in items:
        item.data.transform(item.matrix_basis)
        item.matrix_basis.identity()
        weigh(item, BONES)
        item.modifiers.new("Armature", "ARMATURE").object = bones
    add_keys(whole)
    return items


# An adult, the target of a wrap of the child: longer legs, a smaller head, hanging arms.

PAIRS = (  # crown, nose, hands, feet: on the child, and on the scan
    ((0, 0.02, 1.81), (0, 0.01, 2.24)),
    ((0, -0.335, 1.45), (0, -0.255, 1.99)),
    *(((s * 0.82, 0, 0.97), (s * 0.82, -0.06, 1.05)) for s in (-1, 1)),
    *(((s * 0.13, -0.2, 0.04), (s * 0.19, -0.24, 0.04)) for s in (-1, 1)),
)


def adult_body():
    """The Shape, 2.25 high."""
    middle = [
        Ellipsoid((0, 0.01, 2.03), (0.185, 0.215, 0.225)),
        Ellipsoid((0, -0.22, 1.99), (0.03, 0.045, 0.035), blend=0.03),
        Cone((0, 0.02, 1.62), (0, 0.02, 1.88), 0.08, 0.08, blend=0.05),
        *tube([(0, 0, 1.12), (0, 0, 1.3), (0, 0, 1.58)], [0.19, 0.2, 0.17]),
        *tube([(0, 0, 0.95), (0, 0, 1.05)], [0.2, 0.2], blend=0.06),
    ]
    half = [
        *tube([(0.14, 0.01, 1.57), (0.48, 0, 1.33), (0.72, -0.05, 1.12)], [0.095, 0.075, 0.06], blend=0.07),
        Ellipsoid((0.78, -0.06, 1.06), (0.065, 0.05, 0.08), blend=0.04),
        Ellipsoid((0.18, 0.03, 2.02), (0.03, 0.05, 0.06), blend=0.03),
        *tube([(0.12, 0, 0.9), (0.17, -0.02, 0.5), (0.19, 0.02, 0.14)], [0.135, 0.11, 0.085], blend=0.06),
        Ellipsoid((0.19, -0.07, 0.065), (0.085, 0.19, 0.065), blend=0.03),
    ]
    return build([*middle, *mirrored(half)], 0.05, cells=110)


def beside_child(apart):
    """(child, adult at distance `apart` along x), with landmarks on both; the child carries its clothes."""
    whole, *worn = rigged()
    other = coloured("Grown-up", adult_body())
    other.location.x = apart
    bpy.context.view_layer.update()
    bpy.ops.object.select_all(action="DESELECT")
    for item in (*worn, whole):
        item.select_set(True)
    bpy.context.view_layer.objects.active = whole
    bpy.ops.arapfields.carry(way="FOLLOW")
    whole.arapfields.wrap.onto = other
    for rest, there in PAIRS:
        bpy.ops.arapfields.add_landmark(rest=rest, on_target=Vector(there) + other.location)
    return whole, other
