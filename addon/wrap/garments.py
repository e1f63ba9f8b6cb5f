# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of a source's armatures, clothes and props for a target."""

import numpy as np
from mathutils import Matrix

from ..blender import mesh_arrays, modifier_stack, references
from ..blender.evaluation import depsgraph_of, own_action, remove_curves, with_ancestors
from ..blender.object_references import in_scene, settings_of
from ..carried import carrying
from ..carried.carrying import carrier_class
from ..carried.rest_bones import above_field
from ..carried.transforms import TransformCarrier, array, at_present_rest, world_matrices
from ..core.errors import UserError, refuse
from ..core.geometry import transfer
from ..core.geometry.spaces import facing, inverse, transform
from ..core.runtime import native
from ..field_modifier import motion
from ..handles.empties import matrix_of
from ..names import COPY_OF

# Copies of a source's armatures and carried objects for a target, and their references.


def pairs(source, target):
    """{armature of the source: that of the target}, by modifiers of the same name."""
    both = [(given, target.modifiers.get(given.name)) for given in source.modifiers]
    rigs = [[one and modifier_stack.rig_of(one) for one in pair] for pair in both]
    return {own: other for own, other in rigs if own is not None and other is not None}


def counterparts(source, target):
    """{data-block of the source: the target's}: of both objects and of the armatures that pose them."""
    found = blocks(source, target)
    for given, there in pairs(source, target).items():
        found |= blocks(given, there)
    return found


def blocks(given, there):
    """{data-block: its counterpart} of two objects, their data and their shape keys, if both have any."""
    both = [(given, there), (given.data, there.data)]
    both.append([getattr(item.data, "shape_keys", None) for item in (given, there)])
    return {one: other for one, other in both if one is not None and other is not None}


def copied_object(item, target):
    """A copy with data and actions of its own at the same place, in the target's collections."""
    own = item.copy()
    if item.data is not None:
        own.data = item.data.copy()
    own.name = f"{item.name} {target.name}"
    for block in blocks(item, own).values():
        own_action(block)
    settings_of(own).rest_bones = ""  # its bones are not fitted
    for home in target.users_collection:
        home.objects.link(own)
    return own


def remap_copies(made, twins):
    """Replaces references of copies, {object: its copy}, to one another and by `twins`, {data-block: its
    counterpart}."""
    copies = {}
    for given, there in made.items():
        copies |= blocks(given, there)
    for block in copies.values():
        references.remap(references.parts_of(block), twins | copies)


def copy_drivers(source, target):
    """Copies the drivers of the source's keys; references to the source become those to its counterpart."""
    given, keys = source.data.shape_keys, target.data.shape_keys
    if given.animation_data is None:
        return
    twins = counterparts(source, target)
    for curve in given.animation_data.drivers:
        if keys.animation_data is not None and keys.animation_data.drivers.find(curve.data_path):
            keys.driver_remove(curve.data_path)
        made = keys.animation_data_create().drivers.from_existing(src_driver=curve)
        references.remap(references.read_by(made), twins)


# Fits copies of a wrapped object's carried clothes and props to the target, at the same distance.

PLACING = ("location", "rotation_", "scale", "delta_")  # data paths of transform channels


def copies(context, source, target, given, own):
    """Copies each carried object of the source for the target; returns (count, notes).

    `given`: the source's Given, with its triangles oriented as the target's. `own`: the target's vertices
    and triangles.
    """
    world, there = matrix_of(source), matrix_of(target)
    wrapped, onto = (facing(triangles, there) for triangles in (given.triangles, own[1]))
    body = transfer.Body(
        native.library(),
        (transform(world, given.rest), transform(world, given.moved), wrapped),
        (transform(there, own[0]), onto),
    )
    twins, made, notes = counterparts(source, target), {}, []
    posing = {rig: twins[rig] for rig in above_field(source) if rig in twins}
    for entry in settings_of(source).carried:
        item = entry.item
        if not in_scene(item) or item == target or item.type == "ARMATURE":
            continue
        try:
            refuse(carrying.of_item(source, item))
            shape, matrix = None, array(item.matrix_world)
            if issubclass(carrier_class(item, entry.way), TransformCarrier):
                matrix = placed(context, source, item, entry, body)
            elif item.type == "MESH":
                shape = fitted(context, source, item, body)
            else:
                raise UserError("{name} is not copied: it is no mesh", item)
        except UserError as error:
            notes.append(str(error))
            continue
        made[item] = copy_of(item, target, posing)
        put(context, made[item], target, matrix, shape, posing)
    remap_copies(made, twins)
    return len(made), notes


def placed(context, source, item, entry, body):
    """(4, 4) world matrix of an object carried as a whole: scaled about its center as the body is there."""
    depsgraph = depsgraph_of(context)
    basis = TransformCarrier(context, item).basis(item, entry, depsgraph)
    rigs = modifier_stack.handle_rigs(source)
    world = world_matrices(item, rigs, depsgraph, basis, above_field(source))
    middle = np.array(item.bound_box).mean(axis=0)[None]
    rest, now = (transform(matrix, middle)[0] for matrix in (world.rest, world.now))
    scale, way = body.placed(rest, now)
    grown = np.eye(4)
    grown[:3, :3] *= scale
    grown[:3, 3] = now + way - scale * now
    return grown @ world.now


def fitted(context, source, item, body):
    """(n, 3) vertices of a carried mesh in the world, and (k, n, 3) those of its keys, or None."""
    if not modifier_stack.keeps_vertices(item):
        raise UserError("Modifiers of {name} change its vertices; it is not copied", item)
    world = world_matrices(item, (), depsgraph_of(context), under=above_field(source))
    with modifier_stack.evaluated_mesh(context, item, in_place=True) as mesh:
        rest = transform(world.rest, mesh_arrays.positions(mesh))
        triangles = facing(mesh_arrays.triangles(mesh), world.rest)
    if modifier_stack.find(item) is None:
        raise UserError("The field does not move {name}; wrap again", item)
    with modifier_stack.moved_mesh(context, item) as mesh:
        moved = transform(world.now, mesh_arrays.positions(mesh))
    shape = body.fit(rest, moved, triangles)
    keys = item.data.shape_keys
    if keys is None:
        return shape, None
    points = [
        transform(world.rest, mesh_arrays.vectors(block.data, "co")) - rest for block in keys.key_blocks
    ]
    same = native.library().Correspondence(shape, (rest, triangles), (shape, triangles))
    return shape, shape + same.displacements(np.array(points))


def copy_of(item, target, posing):
    """The copy from an earlier transfer, or a new one."""
    for parent in (target, *posing.values()):
        for child in parent.children:
            if child.get(COPY_OF) == item.name:
                return child
    copied = copied_object(item, target)
    if item.type == "MESH":
        motion.discard(copied)
    copied[COPY_OF] = item.name
    settings_of(copied).carried_by = None
    remove_curves(copied, lambda one: one.data_path.startswith(PLACING))
    return copied


def put(context, copied, target, matrix, shape, posing):
    """Parents and places a copy: on the target, or on the bone of its armature that the original has."""
    rig, bone = bone_of(copied, posing)
    copied.parent, copied.parent_type = (target, "OBJECT") if rig is None else (rig, "BONE")
    if rig is not None:
        copied.parent_bone = bone
    copied.matrix_parent_inverse = Matrix()
    depsgraph = depsgraph_of(context)
    parent = matrix_of(target) if rig is None else at_present_rest(copied, depsgraph)
    copied.matrix_parent_inverse = Matrix(inverse(parent).tolist())
    copied.delta_location, copied.delta_rotation_euler, copied.delta_scale = (0,) * 3, (0,) * 3, (1,) * 3
    copied.matrix_basis = Matrix(matrix.tolist())
    if shape is None:
        return
    back = inverse(matrix)
    mesh_arrays.set_positions(copied.data, transform(back, shape[0]))
    if shape[1] is not None:
        for block, points in zip(copied.data.shape_keys.key_blocks, shape[1], strict=True):
            mesh_arrays.put_vectors(block.data, transform(back, points), "co")


def bone_of(copied, posing):
    """(the target's armature, name of the bone) to parent a copy to; (None, "") without one."""
    for item in with_ancestors(copied):
        rig = posing.get(item.parent, item.parent if item.parent in posing.values() else None)
        if item.parent_type == "BONE" and rig is not None and item.parent_bone in rig.data.bones:
            return rig, item.parent_bone
    return None, ""
