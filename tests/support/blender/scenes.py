# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes for tests in Blender: small meshes, some with all kinds of data that must be kept."""

import tempfile

import bmesh
import bpy
import numpy as np
from support.geometry.nudge import nudged

QUICK = {"iterations": 40, "samples": 1000, "batch": 100, "width": 32, "layers": 2}

NEW = QUICK | {"result": "NEW"}


def activate(*items):
    """Selects the objects and makes the last one active."""
    for other in bpy.context.selected_objects:
        other.select_set(False)
    for item in items:
        item.select_set(True)
    bpy.context.view_layer.objects.active = items[-1]


def bar(name="Bar", length=1.0):
    """A bar along x from -length to length, 0.5 wide, of 8 × 4 × 4 quads a side."""
    mesh = bpy.data.meshes.new(name)
    cube = bmesh.new()
    bmesh.ops.create_cube(cube, size=1.0)
    bmesh.ops.subdivide_edges(cube, edges=cube.edges, cuts=7, use_grid_fill=True)
    bmesh.ops.scale(cube, vec=(2 * length, 0.5, 0.5), verts=cube.verts)
    cube.to_mesh(mesh)
    cube.free()
    nudge(mesh)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(item)
    bpy.context.view_layer.update()
    activate(item)
    return item


def cube_empty(location, half, name="Handle"):
    empty = bpy.data.objects.new(name, None)
    empty.empty_display_type, empty.empty_display_size = "CUBE", 1.0
    empty.location, empty.scale = location, half
    bpy.context.collection.objects.link(empty)
    return empty


def bar_with_handles(name="Bar"):
    """A bar held at its left end, whose right end follows a handle. (bar, fixed, moving)"""
    item = bar(name)
    fixed = cube_empty((-1.0, 0, 0), (0.25, 0.5, 0.5), "Fixed")
    moving = cube_empty((1.0, 0, 0), (0.25, 0.5, 0.5), "Moving")
    bpy.context.view_layer.update()
    activate(fixed, moving, item)
    bpy.ops.arapfields.add_handle()
    activate(item)
    return item, fixed, moving


def from_another_file(*items):
    """Writes the objects to another file, removes them, and links them from it."""
    names, path = [item.name for item in items], f"{tempfile.mkdtemp()}/other.blend"
    bpy.data.libraries.write(path, set(items))
    for item in items:
        bpy.data.objects.remove(item)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = names
    for item in into.objects:
        bpy.context.collection.objects.link(item)
    bpy.context.view_layer.update()
    return into.objects


def camera(size=48):
    """Adds a camera in front, and sets up small renders by Cycles, which needs no GPU."""
    scene = bpy.context.scene
    lens = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    lens.data.type, lens.data.ortho_scale = "ORTHO", 3.2
    lens.location, lens.rotation_euler = (0, -5, 0), (1.5707963, 0, 0)
    scene.collection.objects.link(lens)
    scene.camera, scene.render.engine = lens, "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.device = 1, False, "CPU"
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0, 0, 0, 1)
    scene.render.image_settings.file_format, scene.render.film_transparent = "PNG", True
    return scene


def world_points(item):
    """(n, 3) evaluated vertices of an object, in world space."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = item.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", flat)
    evaluated.to_mesh_clear()
    matrix = np.array(item.matrix_world, dtype=np.float64)
    return flat.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def decorate(item):
    """Adds UVs, colors, materials, groups, flags and custom attributes with varied values."""
    mesh, rng = item.data, np.random.default_rng(0)
    uv = mesh.uv_layers.new(name="UV")
    uv.data.foreach_set("uv", rng.random(2 * len(mesh.loops)).astype(np.float32))
    colours = mesh.color_attributes.new("Colour", "BYTE_COLOR", "CORNER")
    colours.data.foreach_set("color", rng.random(4 * len(mesh.loops)).astype(np.float32))
    for name, kind, domain in (
        ("weight", "FLOAT", "POINT"),
        ("number", "INT", "FACE"),
        ("mark", "BOOLEAN", "EDGE"),
    ):
        attribute = mesh.attributes.new(name, kind, domain)
        attribute.data.foreach_set("value", rng.integers(0, 2, len(attribute.data)))
    for name in ("one", "two"):
        mesh.materials.append(bpy.data.materials.new(name))
    mesh.polygons.foreach_set("material_index", rng.integers(0, 2, len(mesh.polygons)).astype(np.int32))
    group = item.vertex_groups.new(name="Group")
    for index in range(0, len(mesh.vertices), 3):
        group.add([index], float(rng.random()), "REPLACE")
    mesh.edges.foreach_set("use_seam", rng.integers(0, 2, len(mesh.edges)).astype(bool))
    mesh.edges.foreach_set("use_edge_sharp", rng.integers(0, 2, len(mesh.edges)).astype(bool))
    mesh.polygons.foreach_set("use_smooth", rng.integers(0, 2, len(mesh.polygons)).astype(bool))
    mesh.update()
    return item


FIELDS = {"FLOAT": "value", "INT": "value", "BOOLEAN": "value", "FLOAT_VECTOR": "vector", "FLOAT2": "vector"}
FIELDS |= {
    "BYTE_COLOR": "color",
    "FLOAT_COLOR": "color",
    "INT32_2D": "value",
    "INT16_2D": "value",
    "INT8": "value",
}
SIZES = {"vector": {"FLOAT_VECTOR": 3, "FLOAT2": 2}, "color": {"BYTE_COLOR": 4, "FLOAT_COLOR": 4}}


def everything(item):
    """{name: bytes or list} of all data of an object's mesh except positions, comparable."""
    mesh, contents = item.data, {}
    for attribute in mesh.attributes:
        if attribute.name == "position":
            continue
        field = FIELDS[attribute.data_type]
        width = SIZES.get(field, {}).get(attribute.data_type, 2 if "2D" in attribute.data_type else 1)
        whole = attribute.data_type in ("INT", "INT8", "INT32_2D", "INT16_2D")
        flat = np.empty(width * len(attribute.data), dtype=np.int32 if whole else np.float32)
        if attribute.data_type == "BOOLEAN":
            flat = flat.astype(bool)
        attribute.data.foreach_get(field, flat)
        contents[attribute.name, attribute.domain, attribute.data_type] = flat.tobytes()
    for what, field, width in (
        ("loops", "vertex_index", 1),
        ("edges", "vertices", 2),
        ("polygons", "loop_start", 1),
    ):
        flat = np.empty(width * len(getattr(mesh, what)), dtype=np.int32)
        getattr(mesh, what).foreach_get(field, flat)
        contents[what] = flat.tobytes()
    contents["materials"] = [m.name if m else None for m in mesh.materials]
    contents["group names"] = [g.name for g in item.vertex_groups]
    contents["groups"] = [[(g.group, g.weight) for g in v.groups] for v in mesh.vertices]
    return contents


def nudge(mesh):
    """Moves the mesh as support.geometry.nudge moves all shapes."""
    set_positions(mesh, nudged([vertex.co for vertex in mesh.vertices]))


def set_positions(mesh, points):
    mesh.vertices.foreach_set("co", np.asarray(points, np.float32).ravel())
    mesh.update()


def delete(item):
    """Deletes an object as a user does: unlinks it, while pointers may keep the data-block."""
    for home in item.users_collection:
        home.objects.unlink(item)
    bpy.context.view_layer.update()
    assert item.name in bpy.data.objects


def reading_nodes(item, read):
    """Adds a Geometry Nodes modifier without effect that has the object `read` as an input."""
    from addon.field_modifier import node_group  # tests of an installed zip have no `addon`

    group = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    group.interface.new_socket("Goal", in_out="INPUT", socket_type="NodeSocketObject")
    group.interface.new_socket("Share", in_out="INPUT", socket_type="NodeSocketFloat")
    ends = [group.nodes.new(f"NodeGroup{end}") for end in ("Input", "Output")]
    group.links.new(ends[0].outputs[0], ends[1].inputs[0])
    modifier = item.modifiers.new("Nodes", "NODES")
    modifier.node_group = group
    node_group.put(modifier, "Goal", read)
    return modifier


def edit_bones(rig, change):
    """Calls change(edit_bones) in Edit Mode of an armature."""
    activate(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    change(rig.data.edit_bones)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()


FIT = {"iterations": 150, "width": 48, "layers": 2, "near_points": 20000}
