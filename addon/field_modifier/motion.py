# SPDX-License-Identifier: GPL-3.0-or-later
"""Disables Armature modifiers whose bones are handles, while the field poses instead."""

import json
from dataclasses import dataclass

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack, references, splat_layouts
from ..blender.object_references import settings_of
from ..blender.point_data import points_of
from ..blender.references import remove_mesh_object, remove_node_modifier, remove_unused_group
from ..core.errors import UserError
from ..names import FIELD_MODIFIER, HELPER_SUFFIX, OFFSETS, SHAPE_OF
from . import cache_modifier, node_group


def silence_armatures(source):
    """Disables them and stores their visibility; restores those that the field no longer replaces."""
    rigs = modifier_stack.handle_rigs(source)
    noted = read_silenced(source)
    for modifier in source.modifiers:
        if modifier_stack.is_replaced(modifier, rigs):
            if key_of_silenced(noted, modifier) is None:
                noted[str(modifier.persistent_uid)] = [modifier.show_viewport, modifier.show_render]
            modifier.show_viewport = modifier.show_render = False
        elif key_of_silenced(noted, modifier) is not None:
            modifier.show_viewport, modifier.show_render = noted.pop(key_of_silenced(noted, modifier))
    write_silenced(source, noted)


def restore_armatures(source):
    """Restores the visibility of all of them."""
    noted = read_silenced(source)
    for modifier in source.modifiers:
        if key_of_silenced(noted, modifier) is not None:
            modifier.show_viewport, modifier.show_render = noted[key_of_silenced(noted, modifier)]
    write_silenced(source, {})


def key_of_silenced(noted, modifier):
    """Key of a stored modifier: its persistent_uid, or in files of earlier versions its name; or None."""
    keys = str(modifier.persistent_uid), modifier.name
    return next((key for key in keys if key in noted), None)


def read_silenced(source):
    text = settings_of(source).silenced
    return json.loads(text) if text else {}


def write_silenced(source, noted):
    text = json.dumps(noted) if noted else ""
    if settings_of(source).silenced != text:  # any write tags the object as updated
        settings_of(source).silenced = text


# An object's motion: its modifier, and the mesh that stores the offsets.
#
# Offsets are attributes of the mesh itself, or of a helper mesh in no scene if earlier modifiers make the
# vertices, or if the mesh is linked or shared with other objects. While an object is live it has a helper
# in any case, empty if it is not needed, and another one that nothing uses, which it takes when a duplicate
# has come to share the first: both may be needed between two steps of undo (blender/references.py).

written = set()  # session_uids of objects that the add-on itself has moved since the last depsgraph update


@dataclass
class Motion:
    """(n, 3) offsets and rotation vectors (axis · angle) of the points, in local coordinates; None: none."""

    offsets: np.ndarray | None
    turns: np.ndarray | None = None
    changes: dict | None = None  # {attribute of splats: (n,) or (n, 3) its change}


def refusal(source):
    """UserError that says why an object cannot have a field modifier; else None."""
    if source.library is not None:
        return UserError("{name} is linked from another file; choose New Object for the result", source)
    return None


def bind(context, source, expected=None, live=False):
    """Adds the modifier and the mesh that stores the offsets, without any; returns the modifier.

    An existing modifier keeps its place and inputs, and its motion if the number of points is the same.
    UserError if that number is not `expected`. `live`: the helper is added in any case.
    """
    modifier = modifier_stack.find(source)
    with modifier_stack.evaluated_mesh(context, source, in_place=True) as mesh:
        normals, count = modifier_stack.free_normals(mesh), len(points_of(mesh))
        splats = splat_layouts.columns_of(mesh)
    if expected not in (None, count):
        raise UserError("{name} changed while it was worked on; run again", source)
    silence_armatures(source)
    cache_modifier.suspend(source)
    on_mesh = lies_on_mesh(source)
    if splats and not on_mesh:
        raise UserError("{name}: its splats need data and a first modifier of their own", source)
    if modifier is None:
        modifier = add(source, normals, splats)
    else:
        choose_group(modifier, normals, splats)
    node_group.take_mask(source)
    earlier, moved = carrier(source, modifier), snapshot(source)
    if live or not on_mesh:
        take_helper(source, modifier)
    if live and not references.is_between and unused_helper(source) is None:
        new_helper(source)
    if on_mesh:
        leave_helper(modifier, live)
    else:
        fill_helper(context, source, modifier)
    mesh = carrier(source, modifier)
    if len(points_of(mesh)) != count:
        raise UserError("{name} changed while it was worked on; run again", source)
    if mesh != earlier and moved.offsets is not None and len(moved.offsets) == count:
        write_to(mesh, moved)
    return modifier


def lies_on_mesh(source):
    mesh = source.data
    return mesh.library is None and mesh.users == 1 and modifier_stack.keeps_vertices(source)


def add(source, normals, splats):
    """A new field modifier at its place."""
    references.refuse_new(source)
    index = modifier_stack.place(source)
    modifier = source.modifiers.new(FIELD_MODIFIER, "NODES")
    modifier.node_group = node_group.find_or_make(normals, splats)
    source.modifiers.move(source.modifiers.find(modifier.name), index)
    return source.modifiers[index]


def choose_group(modifier, normals, splats):
    """Replaces the node group if the domain of the normals has changed."""
    if not node_group.is_for(modifier, normals, splats):
        references.refuse_new(modifier.id_data)
        take_group(modifier, node_group.find_or_make(normals, splats))


def take_group(modifier, group):
    """Replaces the node group of a field modifier; keeps the user's inputs."""
    if modifier.node_group == group:
        return
    factor, mask = node_group.get(modifier, "Factor"), node_group.get(modifier, "Mask")
    masked, helper = node_group.get_attribute(modifier, "Mask"), node_group.get(modifier, "Offsets")
    old, modifier.node_group = modifier.node_group, group
    remove_unused_group(old)
    for name, value in (("Factor", factor), ("Mask", mask), ("Offsets", helper)):
        node_group.put(modifier, name, value)
    node_group.put_attribute(modifier, "Mask", masked)


def take_helper(source, modifier):
    """Gives the modifier a helper of its own, unless it has one; between two steps of undo, where none is at
    hand, also one that it shares with a duplicate will do. Returns it."""
    helper = node_group.get(modifier, "Offsets")
    is_ours = helper is not None and helper.library is None
    if is_ours and users_of(helper) == 1:
        return helper
    own = unused_helper(source)
    if own is None:
        if is_ours and references.is_between:
            return helper
        references.refuse_new(source)
        own = new_helper(source)
    if helper is not None:
        mesh_arrays.take_geometry(own.data, helper.data)
        write_to(own.data, read_from(helper.data))
    node_group.put(modifier, "Offsets", own)
    return own


def part_with_copies(source):
    """Gives a live source's modifier a helper that no duplicate shares, if one is at hand."""
    modifier = None if source is None else modifier_stack.find(source)
    if modifier is not None:
        take_helper(source, modifier)


def new_helper(source):
    mesh = bpy.data.meshes.new(f"{source.name}{HELPER_SUFFIX}")
    return bpy.data.objects.new(mesh.name, mesh)


def fill_helper(context, source, modifier):
    """Gives the helper the vertices and faces at the modifier's place."""
    shown = modifier_stack.mesh_copy(context, source, in_place=True)
    mesh = node_group.get(modifier, "Offsets").data
    try:
        mesh_arrays.take_geometry(mesh, shown)
    finally:
        bpy.data.meshes.remove(shown)
    if OFFSETS not in mesh.attributes:
        unmark(mesh)


def leave_helper(modifier, live=False):
    """Empties the helper, or one that is a duplicate's too is no longer the modifier's; `live`: it stays."""
    helper = node_group.get(modifier, "Offsets")
    if helper is None:
        return
    if users_of(helper) > 1 or helper.library is not None:
        if len(helper.data.vertices):
            node_group.put(modifier, "Offsets", None)
    elif live or references.keeps_unused:
        empty(helper)
    else:
        node_group.put(modifier, "Offsets", None)
        discard_helper(helper)


def drop_unused_helpers(source):
    """Called when live mode ends."""
    modifier = modifier_stack.find(source)
    if modifier is not None and carrier(source, modifier) == source.data:
        leave_helper(modifier)
    if (unused := unused_helper(source)) is not None:
        discard_helper(unused)


def unused_helper(source):
    """A helper that an earlier modifier of the source, or live mode, has left in the file, emptied; or
    None."""
    named = [one for one in bpy.data.objects if one.name.startswith(f"{source.name}{HELPER_SUFFIX}")]
    helpers = [one for one in named if one.type == "MESH" and one.library is None and users_of(one) == 0]
    if not helpers:
        return None
    empty(helpers[0])
    return helpers[0]


def empty(helper):
    """Takes the points and offsets away, and the mark of the shape that these were."""
    helper.data.clear_geometry()
    unmark(helper.data)


def unmark(mesh):
    if SHAPE_OF in mesh:
        del mesh[SHAPE_OF]


def users_of(helper):
    """Number of users; Blender 5.2 counts too many in `users` for objects in modifier inputs."""
    return len(bpy.data.user_map(subset=[helper])[helper])


def discard_helper(helper):
    if users_of(helper) == 0 and helper.library is None and not references.keeps_unused:
        remove_mesh_object(helper)


def carrier(source, modifier):
    """The mesh that stores the offsets: the helper's unless that is empty."""
    helper = node_group.get(modifier, "Offsets")
    return source.data if helper is None or not len(helper.data.vertices) else helper.data


def write(source, motion):
    """Writes a Motion to the object; UserError if its modifier is missing or the points have changed."""
    modifier = modifier_stack.find(source)
    if modifier is None:
        raise UserError("The modifier of {name} was removed", source)
    written.add(source.session_uid)
    mesh = carrier(source, modifier)
    if len(points_of(mesh)) != len(motion.offsets):
        raise UserError("{name} changed while it was worked on; run again", source)
    write_to(mesh, motion)


def write_to(mesh, motion, number=""):
    """`number`: the layer's, if the motion is that of a layer."""
    for name, vectors in zip(node_group.names_of(number), (motion.offsets, motion.turns), strict=True):
        attribute = mesh.attributes.get(name)
        if vectors is None:
            if attribute is not None:
                mesh.attributes.remove(attribute)
            continue
        if attribute is not None and (attribute.domain, attribute.data_type) != ("POINT", "FLOAT_VECTOR"):
            mesh.attributes.remove(attribute)
            attribute = None
        if attribute is None:
            attribute = mesh.attributes.new(name, "FLOAT_VECTOR", "POINT")
        mesh_arrays.put_vectors(attribute.data, vectors)
    splat_layouts.put_changes(mesh, motion.changes or {})
    mesh.update_tag()


def read_from(mesh, number=""):
    moved = (vectors(mesh, name) for name in node_group.names_of(number))
    return Motion(*moved, splat_layouts.changes_of(mesh))


def shown_points(source):
    """(n, 3) float32 points of an object's own data, plus its offsets if the field's modifier is on."""
    points = mesh_arrays.vectors(*mesh_arrays.position_vectors(source.data))
    modifier = modifier_stack.find(source)
    offsets = vectors(source.data, OFFSETS) if modifier is not None and modifier.show_viewport else None
    return points if offsets is None else points + offsets


def vectors(mesh, name):
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.data_type != "FLOAT_VECTOR" or attribute.domain != "POINT":
        return None
    return mesh_arrays.vectors(attribute.data)


def snapshot(source):
    """The object's Motion, for restore(); None without a field modifier."""
    modifier = modifier_stack.find(source)
    return None if modifier is None else read_from(carrier(source, modifier))


def restore(source, motion):
    """Restores a snapshot bit for bit; without offsets if the number of points has changed."""
    modifier = modifier_stack.find(source)
    if motion is None:
        remove(source)
    elif modifier is not None:
        mesh = carrier(source, modifier)
        fits = motion.offsets is not None and len(motion.offsets) == len(points_of(mesh))
        write_to(mesh, motion if fits else Motion(None))


def remove(source):
    """Removes the modifier with its helper data, and enables the object's Armature modifiers."""
    discard(source)
    restore_armatures(source)


def discard(source):
    """Removes the modifier once the mesh contains its motion."""
    modifier = modifier_stack.find(source)
    if modifier is not None:
        helper = node_group.get(modifier, "Offsets")
        remove_node_modifier(modifier)
        if helper is not None:
            discard_helper(helper)
    if settings_of(source).under_rig:  # any write tags the object as updated
        settings_of(source).under_rig = False
    if settings_of(source).moved_by:
        settings_of(source).moved_by = ""
    if source.data.library is None and source.data.users == 1:
        write_to(source.data, Motion(None))
