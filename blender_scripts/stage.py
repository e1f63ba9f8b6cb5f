# SPDX-License-Identifier: GPL-3.0-or-later
"""A studio for renders: backdrop, lights, camera, materials and coloured handle boxes."""

import math
import os
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

DRAFT = "STAGE_DRAFT" in os.environ  # smaller pictures with fewer samples, for drafts
CLAY = (0.62, 0.60, 0.56)
RESULT = (0.93, 0.55, 0.20)
SURFACE = (0.30, 0.52, 0.75)
PIN, ANCHOR = (0.95, 0.30, 0.02), (0.02, 0.16, 0.75)
BOX_COLOURS = [
    (0.05, 0.25, 0.85),
    (0.85, 0.06, 0.05),
    (0.05, 0.60, 0.12),
    (0.75, 0.10, 0.70),
    (0.90, 0.65, 0.02),
]


def clear():
    """Removes all objects of the open file."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item, do_unlink=True)


def material(name, colour, roughness=0.45, alpha=1.0):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1.0)
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Alpha"].default_value = alpha
    made.diffuse_color = (*colour, alpha)
    return made


def vertex_paint(name, roughness=0.45):
    """A material that shows the colour attribute `colour`."""
    made = material(name, (1, 1, 1), roughness)
    node = made.node_tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "colour"
    shader = made.node_tree.nodes["Principled BSDF"]
    made.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    return made


def paint(target, colour):
    target.data.materials.clear()
    target.data.materials.append(material(f"{target.name} paint", colour))


def box(name, matrix, colour, edge=0.012):
    """A box drawn by its edges; `matrix` maps the cube [-1,1]³ onto it."""
    corners = [Vector((x, y, z)) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    ends = [
        (a, b)
        for a in range(8)
        for b in range(a)
        if sum(i != j for i, j in zip(corners[a], corners[b], strict=True)) == 1
    ]
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", edge, 3
    for a, b in ends:
        line = curve.splines.new("POLY")
        line.points.add(1)
        line.points[0].co = (*(matrix @ corners[a]), 1)
        line.points[1].co = (*(matrix @ corners[b]), 1)
    curve.materials.append(material(f"{name} edge", colour, roughness=0.6))
    made = bpy.data.objects.new(name, curve)
    bpy.context.collection.objects.link(made)
    return made


def caption(text, location, size=0.22):
    curve = bpy.data.curves.new(f"caption {text}", "FONT")
    curve.body, curve.align_x, curve.size = text, "CENTER", size
    curve.materials.append(material(f"caption {text}", (0.05, 0.05, 0.06), roughness=1.0))
    made = bpy.data.objects.new(f"caption {text}", curve)
    made.location = location
    made.rotation_euler = (math.radians(90), 0, 0)
    made.visible_shadow = False
    bpy.context.collection.objects.link(made)
    return made


def pin(place, anchor):
    """A ball for a pin, or a cube for an anchor."""
    if anchor:
        bpy.ops.mesh.primitive_cube_add(size=0.09, location=place)
    else:
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.06, location=place)
    made = bpy.context.object
    made.data.materials.append(material("Anchor" if anchor else "Pin", ANCHOR if anchor else PIN, 0.3))
    return made


def bounds(objects, turn=None):
    """Low and high corner of the objects' boxes in world space, after the inverse of `turn` (4, 4)."""
    back = (turn or Matrix.Identity(4)).inverted()
    corners = [back @ item.matrix_world @ Vector(c) for item in objects for c in item.bound_box]
    low = Vector(min(c[axis] for c in corners) for axis in range(3))
    return low, Vector(max(c[axis] for c in corners) for axis in range(3))


def backdrop(floor_z, depth, width, turn):
    """A floor that curves up into a wall at +y, without a visible horizon, then rotated by `turn`."""
    radius, steps = 3.0, 24
    profile = (
        [(-40.0, 0.0)]
        + [
            (depth + radius * math.sin(a), radius - radius * math.cos(a))
            for a in (math.pi / 2 * i / steps for i in range(steps + 1))
        ]
        + [(depth + radius, 40.0)]
    )
    vertices = [(x, y, floor_z + z) for y, z in profile for x in (-width, width)]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(profile) - 1)]
    mesh = bpy.data.meshes.new("backdrop")
    mesh.from_pydata(vertices, [], faces)
    mesh.polygons.foreach_set("use_smooth", [True] * len(faces))
    mesh.materials.append(material("backdrop", (0.93, 0.85, 0.71), roughness=0.9))
    made = bpy.data.objects.new("backdrop", mesh)
    made.matrix_world = turn
    bpy.context.collection.objects.link(made)


def light(name, location, target, energy, size, colour=(1, 1, 1)):
    data = bpy.data.lights.new(name, "AREA")
    data.energy, data.size, data.color = energy, size, colour
    made = bpy.data.objects.new(name, data)
    made.matrix_world = look_at(Vector(location), Vector(target))
    bpy.context.collection.objects.link(made)


def look_at(eye, target):
    return Matrix.Translation(eye) @ (target - eye).to_track_quat("-Z", "Y").to_matrix().to_4x4()


def outline(objects):
    """(n, 3) points in world space that a picture must contain: vertices, or corners of boxes."""
    points = []
    for item in objects:
        local = [v.co for v in item.data.vertices] if item.type == "MESH" else map(Vector, item.bound_box)
        points += [tuple(item.matrix_world @ point) for point in local]
    return np.array(points)


def frame(camera, points, margin):
    """Translates the camera until the points fill its width; returns the aspect, height over width."""
    axes = np.array(camera.matrix_world.to_3x3())
    eye, half_width = np.array(camera.matrix_world.translation), math.tan(camera.data.angle / 2)
    for _ in range(30):
        seen = (points - eye) @ axes
        depth = -seen[:, 2]
        across, up = seen[:, 0] / depth, seen[:, 1] / depth
        middle, reach = depth.mean(), np.ptp(across) / 2 * (1 + 2 * margin)
        shift = (across.max() + across.min(), up.max() + up.min(), 2 * (reach / half_width - 1))
        eye = eye + axes @ np.array(shift) * middle / 2
    camera.matrix_world.translation = Vector(eye)
    return (np.ptp(up) + 2 * margin * np.ptp(across)) / (2 * reach)


def set_up(objects, width=1200, samples=24, elevation=12.0, azimuth=0.0, threads=0, margin=0.025, around=()):
    """Adds backdrop, lights and a camera along +y that frames the objects; `azimuth` rotates all of these.

    `around`: further points in the picture; rows of a sheet with the same points have the same scale.
    """
    bpy.context.view_layer.update()
    turn = Matrix.Rotation(math.radians(azimuth), 4, "Z")
    low, high = bounds(objects, turn)
    middle, extent = turn @ ((low + high) / 2), high - low
    span = extent.x
    backdrop(low.z - 0.002 * extent.z, high.y + 0.6 * span, 20 * span, turn)
    for name, where, energy, size, colour in (
        ("key", (-0.55, -0.9, 0.9), 8.5, 0.35, (1, 0.96, 0.9)),
        ("fill", (0.9, -0.7, 0.35), 1.8, 0.6, (0.88, 0.94, 1)),
        ("rim", (0.3, 0.5, 0.9), 4, 0.4, (1, 1, 1)),
    ):
        light(name, middle + turn @ (Vector(where) * span), middle, energy * span**2, size * span, colour)

    data = bpy.data.cameras.new("camera")
    data.lens, data.sensor_fit = 70, "HORIZONTAL"  # also for pictures that are higher than wide
    camera = bpy.data.objects.new("camera", data)
    bpy.context.collection.objects.link(camera)
    a, e = math.radians(azimuth), math.radians(elevation)
    towards = Vector((math.sin(a) * math.cos(e), -math.cos(a) * math.cos(e), math.sin(e)))
    camera.matrix_world = look_at(middle + towards * 2 * span, middle)
    bpy.context.view_layer.update()
    points = np.concatenate([outline(objects), np.reshape(around, (-1, 3))])
    size = (width, 2 * round(width * frame(camera, points, margin) / 2))

    scene = bpy.context.scene
    scene.camera = camera
    scene.world = scene.world or bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.9, 0.93, 1.0, 1)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.35
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 40 if DRAFT else 100
    if threads:
        render.threads_mode, render.threads = "FIXED", threads
    scene.cycles.device, scene.cycles.samples = "CPU", 6 if DRAFT else samples
    scene.cycles.use_denoising = True
    # With the denoiser, fewer samples give the same picture in two thirds of the time.
    scene.cycles.adaptive_threshold, scene.cycles.adaptive_min_samples = 0.1, 6
    scene.cycles.max_bounces, scene.cycles.diffuse_bounces, scene.cycles.glossy_bounces = 3, 2, 2
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "Medium High Contrast"


def brighten(times):
    """Brightens the world, for a figure whose wall is far away."""
    for data in list(bpy.data.lights):
        data.energy *= times
    bpy.context.scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value *= times


def take(path):
    """Renders a PNG with Cycles."""
    render = bpy.context.scene.render
    render.filepath, render.image_settings.file_format = str(Path(path).resolve()), "PNG"
    bpy.ops.render.render(write_still=True)


def photograph(objects, path, **options):
    """Renders a picture of the objects, with options of `set_up`."""
    set_up(objects, **options)
    take(path)
