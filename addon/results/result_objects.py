# SPDX-License-Identifier: GPL-3.0-or-later
"""Result objects: made once for a source and kind, updated in place by later runs."""

import json

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.actions import key_at
from ..blender.object_references import settings_of
from ..blender.references import remove_mesh_object
from ..core.errors import UserError
from ..field_modifier import motion
from ..names import REPORT, RESULT_SUFFIX, RESULTS, WARP_KEY


def collection(context):
    """The scene's collection for results; each scene has its own."""
    for child in context.scene.collection.children:
        if child.name.split(".")[0] == RESULTS and child.library is None:
            return child
    home = bpy.data.collections.new(RESULTS)
    context.scene.collection.children.link(home)
    return home


def discard(item):
    """Removes a result object with its mesh, its keys' action, and its collection if that is empty."""
    homes = list(item.users_collection)
    remove_mesh_object(item)
    for home in homes:
        if home.name.split(".")[0] == RESULTS and not home.all_objects and not home.children:
            bpy.data.collections.remove(home)


def existing(context, source, kind, output):
    """The result object of an earlier run, if it can be written to; else None."""
    for entry in settings_of(source).results:
        item = entry.item
        if entry.kind == kind and entry.output == output and item is not None:
            if item.mode == "EDIT" or item.library or context.scene.objects.get(item.name) != item:
                continue
            return item
    return None


def register(source, kind, output, item):
    entries = settings_of(source).results
    earlier = (entry for entry in entries if entry.kind == kind and entry.output == output)
    entry = next(earlier, None) or entries.add()
    entry.kind, entry.output, entry.item = kind, output, item
    settings_of(item).made_from = source.name


def show(context, source, kind, output, mesh, report, select=True):
    """Gives the mesh to the source's result object of that kind, with the source's transform."""
    item = existing(context, source, kind, output)
    mesh.name = f"{source.name}{RESULT_SUFFIX[kind]}"
    if item is None:
        item = bpy.data.objects.new(f"{source.name}{RESULT_SUFFIX[kind]}", mesh)
        collection(context).objects.link(item)
        look_like(source, item)
    else:
        old, item.data = item.data, mesh
        if old.users == 0:
            bpy.data.meshes.remove(old)
    register(source, kind, output, item)
    place(context, source, item)
    item[REPORT] = json.dumps(report)
    if select and context.view_layer.objects.active == source:
        select_only(context, item)
    return item


SEEN_BY = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
LOOKS = ("color", "pass_index", "is_shadow_catcher", "is_holdout", *(f"visible_{ray}" for ray in SEEN_BY))


def look_like(source, item):
    """Copies the source's object-level look to a new result: material slots, ray visibility."""
    for given, slot in zip(source.material_slots, item.material_slots, strict=False):
        if given.link == "OBJECT":
            slot.link, slot.material = "OBJECT", given.material
    for name in LOOKS:
        setattr(item, name, getattr(source, name))


CHANNELS = ("rotation_mode", "location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle")
CHANNELS += ("scale", "delta_location", "delta_rotation_euler", "delta_rotation_quaternion", "delta_scale")


def place(context, source, item):
    """Gives a result its source's transform: the same parent and the same channels.

    A world matrix alone would lose the shear of non-uniformly scaled parents. It is used only if
    constraints or the like move the source beyond its channels.
    """
    item.parent, item.parent_type, item.parent_bone = source.parent, source.parent_type, source.parent_bone
    if source.parent_type in ("VERTEX", "VERTEX_3"):
        item.parent_vertices = source.parent_vertices
    item.matrix_parent_inverse = source.matrix_parent_inverse
    for channel in CHANNELS:
        setattr(item, channel, getattr(source, channel))
    context.view_layer.update()
    if not np.allclose(item.matrix_world, source.matrix_world, rtol=1e-6, atol=1e-6):
        item.parent = None
        item.matrix_world = source.matrix_world.copy()
        context.view_layer.update()


def select_only(context, item):
    if context.mode != "OBJECT" or context.view_layer.objects.get(item.name) != item:
        return
    for other in context.selected_objects:
        other.select_set(False)
    item.select_set(True)
    context.view_layer.objects.active = item


def surface_mesh(source, vertices, topology):
    """A mesh of the implicit surface, in local coordinates, with the source's materials."""
    mesh = mesh_arrays.new_mesh(source.name, vertices, topology)
    for material in source.data.materials:
        mesh.materials.append(material)
    if settings_of(source).normals == "FLAT":
        mesh.shade_flat()
    return mesh


def warp_mesh(context, source, before, after):
    """A copy of the source's mesh with its vertices moved from `before` to `after`, (n, 3) each.

    All other data are kept. If modifiers change the vertices, the evaluated mesh is copied.
    """
    copied = source.data.copy()
    if keeps_vertices(source) and len(copied.vertices) == len(before):
        motion.write_to(copied, motion.Motion(None))
        if copied.shape_keys is None:
            mesh_arrays.set_positions(copied, after)
        return copied
    bpy.data.meshes.remove(copied)
    applied = shown_mesh(context, source, len(after))
    mesh_arrays.set_positions(applied, after)
    return applied


def shown_mesh(context, source, count, in_place=False):
    """A new mesh with the source's shape keys and modifiers applied: all, or with `in_place` those before the
    field's modifier."""
    applied = modifier_stack.mesh_copy(context, source, in_place)
    if len(applied.vertices) != count:
        bpy.data.meshes.remove(applied)
        raise UserError("{name} changed while it was worked on; run again", source)
    return applied


def add_frame(item, frames, number, shape):
    """Adds a shape key for a frame, keyframed with 1 at it and 0 at the frames beside it."""
    if number == 0:
        item.shape_key_add(name="Basis", from_mix=False)
    key = item.shape_key_add(name=f"frame {frames[number]}", from_mix=False)
    mesh_arrays.put_vectors(key.data, shape, "co")
    for frame in frames[max(0, number - 1) : number + 2]:
        key.value = float(frame == frames[number])
        key_at(key, "value", frame)


def keeps_vertices(source, in_place=False):
    """Whether the shape to solve has the vertices of the object's own mesh: no modifier acts on it, except
    the field's lower layers with `in_place`."""
    keys = source.data.shape_keys
    usable = keys is None or (keys.use_relative and not source.show_only_shape_key)
    before = modifier_stack.shown_before(source, in_place)
    return usable and all(in_place and modifier_stack.is_layer(modifier) for modifier in before)


def add_warp_key(item, before, after):
    """Adds the motion as a shape key to a mesh with keys: all other keys and values stay."""
    keys = item.data.shape_keys
    old = keys.key_blocks.get(WARP_KEY)
    if old is not None:
        item.shape_key_remove(old)
    key = item.shape_key_add(name=WARP_KEY, from_mix=False)
    basis = mesh_arrays.vectors(key.relative_key.data, "co")
    mesh_arrays.put_vectors(key.data, basis + (after - before), "co")
    key.value = 1.0
    item.data.update()
