# SPDX-License-Identifier: GPL-3.0-or-later
"""An object's motion: its modifier, and where the offsets lie.

They lie on the mesh itself; on a helper mesh, in no scene, where modifiers before make the vertices, other
objects share the mesh, or it is linked.
"""

from dataclasses import dataclass

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack, splat_layouts
from ..blender.object_references import settings_of
from ..blender.point_data import points_of
from ..blender.removal import remove_mesh_object, remove_node_modifier
from ..core.errors import UserError
from ..names import FIELD_MODIFIER, HELPER_SUFFIX, OFFSETS, TURNS
from . import armatures, cache_modifier, inputs, masks, node_group

written = set()  # session_uid of objects that were moved since Blender's last update, which is ours alone


@dataclass
class Motion:
    """(n, 3) offsets and turns (axis · angle) of the points, in local coordinates; None: there are none."""

    offsets: np.ndarray | None
    turns: np.ndarray | None = None
    changes: dict | None = None  # {attribute of splats: (n,) or (n, 3) what is added to it}


def refusal(source):
    """Why an object cannot have a field modifier, as a UserError; None where it can."""
    if source.library is not None:
        return UserError("{name} is linked from another file; choose New Object for the result", source)
    return None


def bind(context, source, expected=None):
    """Gives the object its modifier and a mesh that carries the offsets, none yet; returns the modifier.

    Where there is one already, its place and inputs stay, and its motion where the points are as many.
    UserError where the points are not as many as `expected`.
    """
    modifier, copied = modifier_stack.find(source), None
    with modifier_stack.evaluated_mesh(context, source, in_place=True) as mesh:
        normals, count = modifier_stack.free_normals(mesh), len(points_of(mesh))
        splats = splat_layouts.columns_of(mesh)
    if expected not in (None, count):
        raise UserError("{name} changed while it was worked on; run again", source)
    armatures.silence(source)
    cache_modifier.suspend(source)
    on_mesh = lies_on_mesh(source)
    if splats and not on_mesh:
        raise UserError("{name}: its splats need data and a first modifier of their own", source)
    if not on_mesh:
        copied = modifier_stack.mesh_copy(context, source, in_place=True)
    if modifier is None:
        modifier = add(source, normals, splats)
    else:
        choose_group(modifier, normals, splats)
    masks.take(source)
    if on_mesh:
        forget_helper(modifier)
    else:
        take_helper(source, modifier, copied)
    mesh = carrier(source, modifier)
    if len(points_of(mesh)) != count:
        raise UserError("{name} changed while it was worked on; run again", source)
    return modifier


def lies_on_mesh(source):
    mesh = source.data
    return mesh.library is None and mesh.users == 1 and modifier_stack.keeps_vertices(source)


def add(source, normals, splats):
    """A new field modifier at its place."""
    index = modifier_stack.place(source)
    modifier = source.modifiers.new(FIELD_MODIFIER, "NODES")
    modifier.node_group = node_group.find_or_make(normals, splats)
    source.modifiers.move(source.modifiers.find(modifier.name), index)
    return source.modifiers[index]


def choose_group(modifier, normals, splats):
    """Exchanges the node group where the normals ask for another."""
    take_group(modifier, node_group.find_or_make(normals, splats))


def take_group(modifier, group):
    """Gives a modifier of ours another node group; what the user set stays."""
    if modifier.node_group == group:
        return
    factor, mask = inputs.get(modifier, "Factor"), inputs.get(modifier, "Mask")
    masked, helper = inputs.get_attribute(modifier, "Mask"), inputs.get(modifier, "Offsets")
    old, modifier.node_group = modifier.node_group, group
    if old.users == 0:
        bpy.data.node_groups.remove(old)
    for name, value in (("Factor", factor), ("Mask", mask), ("Offsets", helper)):
        inputs.put(modifier, name, value)
    inputs.put_attribute(modifier, "Mask", masked)


def take_helper(source, modifier, mesh):
    """Has the modifier read its offsets from this mesh."""
    own = [one.name for one in mesh.attributes if not (one.is_required or one.is_internal)]
    for name in own:  # not the attributes themselves: Blender moves those left when one is removed
        if name not in (OFFSETS, TURNS):
            mesh.attributes.remove(mesh.attributes[name])
    mesh.materials.clear()
    helper = inputs.get(modifier, "Offsets")
    mesh.name = f"{source.name}{HELPER_SUFFIX}"
    if helper is None or users_of(helper) > 1 or helper.library is not None:  # a copied object shares it
        inputs.put(modifier, "Offsets", bpy.data.objects.new(mesh.name, mesh))
        return
    old, count = helper.data, len(points_of(mesh))
    motion = read_from(old)
    helper.data = mesh
    bpy.data.meshes.remove(old)
    if motion.offsets is not None and len(motion.offsets) == count:
        write_to(mesh, motion)


def forget_helper(modifier):
    helper = inputs.get(modifier, "Offsets")
    if helper is not None:
        inputs.put(modifier, "Offsets", None)
        discard_helper(helper)


def users_of(helper):
    """How many use it; `users` counts too many of what an input of a modifier names, in Blender 5.2."""
    return len(bpy.data.user_map(subset=[helper])[helper])


def discard_helper(helper):
    if users_of(helper) == 0 and helper.library is None:
        remove_mesh_object(helper)


def carrier(source, modifier):
    """The mesh on which the offsets lie."""
    helper = inputs.get(modifier, "Offsets")
    return source.data if helper is None else helper.data


def write(source, motion):
    """Moves the object's points; UserError where its modifier is gone or the points are others."""
    modifier = modifier_stack.find(source)
    if modifier is None:
        raise UserError("The modifier of {name} was removed", source)
    written.add(source.session_uid)
    mesh = carrier(source, modifier)
    if len(points_of(mesh)) != len(motion.offsets):
        raise UserError("{name} changed while it was worked on; run again", source)
    write_to(mesh, motion)


def write_to(mesh, motion, number=""):
    """`number`: of the layer whose motion it is."""
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
    """(n, 3) the points of an object's own data, with its offsets where the field is on; single precision."""
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
    """The object's motion, to be restored; None where it has no field modifier."""
    modifier = modifier_stack.find(source)
    return None if modifier is None else read_from(carrier(source, modifier))


def restore(source, motion):
    """Makes the object's motion what a snapshot holds, bit for bit; points that are others do not move."""
    modifier = modifier_stack.find(source)
    if motion is None:
        remove(source)
    elif modifier is not None:
        mesh = carrier(source, modifier)
        fits = motion.offsets is not None and len(motion.offsets) == len(points_of(mesh))
        write_to(mesh, motion if fits else Motion(None))


def remove(source):
    """Takes the object's modifier away, with all that was made for it; its armature poses it again."""
    discard(source)
    armatures.restore(source)


def discard(source):
    """Takes the object's modifier away where what it moved is part of the mesh now."""
    modifier = modifier_stack.find(source)
    if modifier is not None:
        helper = inputs.get(modifier, "Offsets")
        remove_node_modifier(modifier)
        if helper is not None:
            discard_helper(helper)
    if settings_of(source).under_rig:  # a write counts as a change of the object
        settings_of(source).under_rig = False
    if settings_of(source).moved_by:
        settings_of(source).moved_by = ""
    if source.data.library is None and source.data.users == 1:
        write_to(source.data, Motion(None))
