# SPDX-License-Identifier: GPL-3.0-or-later
"""Movers: the Empty or the bone that moves a handle, and its matrix."""

import bpy
import numpy as np
from mathutils import Matrix

from ..blender.evaluation import is_disabled, is_moved, with_ancestors, world_matrix
from ..blender.object_references import has_handle, in_scene, settings_of
from ..blender.property_definitions import listeners
from ..blender.references import parts_of, references, takes_references
from ..core.errors import UserError
from ..core.geometry.handles import box_matrix
from ..core.geometry.spaces import inverse
from ..names import BONE_NUMBER


def matrix_of(item, bone=""):
    """(4, 4) world matrix of an object, or of its pose bone of that name."""
    matrix = np.array(world_matrix(item), dtype=np.float64)
    return matrix @ np.array(item.pose.bones[bone].matrix, dtype=np.float64) if bone else matrix


def is_frozen(item):
    """Whether an object is animated or driven, but disabled, so that Blender does not evaluate it."""
    bones, parent = item.pose.bones if item.pose is not None else (), item.parent
    moves = is_moved(item) or any(bone.constraints for bone in bones)
    return is_disabled(item) and (moves or (parent is not None and is_frozen(parent)))


def is_needed(item, source):
    """Whether Blender evaluates a disabled object, as enabled objects other than the source use it."""
    users = bpy.data.user_map(subset=[item])[item]
    others = [one for one in users if isinstance(one, bpy.types.Object) and one not in (source, item)]
    return any(not is_disabled(one) for one in others)


def frozen(entries):
    """UserError that names a mover which is disabled and not evaluated; else None."""
    for entry in entries:
        mover = mover_of(entry)
        if is_frozen(mover) and not is_needed(mover, entry.id_data):
            return UserError(
                "{name} is disabled in viewports, so that nothing moves it; hide it by its eye instead", mover
            )
    return None


def rest_of(entry):
    """(4, 4) cube [-1, 1]³ → the source's coordinates, of a handle's rest box."""
    return np.array(entry.rest, dtype=np.float64).reshape(4, 4)


def current_box(empty, where=matrix_of):
    """(4, 4) cube [-1, 1]³ → world, of an Empty's present box."""
    return box_matrix(where(empty), empty.empty_display_size)


def is_child(entry):
    """Whether a handle belongs to its object: its Empty is a child of it that nothing else moves."""
    empty = entry.empty if entry.kind != "BONE" else None
    if empty is None or empty.parent != entry.id_data or empty.parent_type != "OBJECT":
        return False
    return all(constraint.mute for constraint in empty.constraints)


def box_in_source(entry, where=matrix_of, rendered=None):
    """(4, 4) cube [-1, 1]³ → the source's coordinates, of a handle's present box.

    Of a child it does not depend on the source's place, not even in its last bits. `rendered`: a render's
    depsgraph to read it from.
    """
    if not is_child(entry):
        return inverse(where(entry.id_data)) @ box_now(entry, where)
    empty = entry.empty if rendered is None else entry.empty.original.evaluated_get(rendered)
    own = np.array(empty.matrix_parent_inverse, dtype=np.float64) @ np.array(empty.matrix_basis)
    return box_matrix(own, empty.empty_display_size)


def attach(empty, source):
    """Makes an Empty a child of the source, in its place; one that the source follows stays as it is."""
    world = matrix_of(source)
    if any(empty in followed(one) for one in with_ancestors(source)) or not np.linalg.det(world[:3, :3]):
        return
    empty.parent, empty.parent_type = source, "OBJECT"
    empty.matrix_parent_inverse = Matrix(inverse(world).tolist())


def followed(item):
    """The data-blocks that may move an object: itself, and those that its modifiers, constraints and drivers
    read."""
    return [item, *(value for part in parts_of(item) for _, value in references(part))]


def detach(empty):
    """Makes an Empty nothing's child, in its place."""
    matrix = Matrix(matrix_of(empty).tolist())
    empty.parent = None
    empty.matrix_world = matrix


def put_in_world(entry, is_held):
    """Has a handle stay in the world, or move with its object."""
    if entry.kind == "BONE" or entry.empty is None or is_held == in_world(entry):
        return
    if not takes_references(entry.empty):
        return
    if entry.empty.parent is not None:
        detach(entry.empty)
    if not is_held:
        attach(entry.empty, entry.id_data)


def in_world(entry):
    """Whether a handle's Empty is no child of its object."""
    return entry.empty is None or entry.empty.parent != entry.id_data


listeners["in_world"] = put_in_world


def bone_of(entry):
    """The present name of a handle's bone, found by its number."""
    bones = entry.rig.data.bones
    named = bones.get(entry.bone)
    if not entry.number or (named is not None and getattr(named, BONE_NUMBER) == entry.number):
        return entry.bone
    return next((bone.name for bone in bones if getattr(bone, BONE_NUMBER) == entry.number), entry.bone)


def group_of(entry):
    """The present name of a handle's vertex group: Blender renames groups with their bones."""
    if entry.kind != "BONE" or not entry.group or entry.group != entry.bone or not in_scene(entry.rig):
        return entry.group
    name = bone_of(entry)
    return name if name in entry.id_data.vertex_groups else entry.group


def follow_rename(entry):
    """Stores the present names of a handle's bone and its vertex group."""
    if entry.kind != "BONE":
        return
    if bone_of(entry) != entry.bone:
        entry.group, entry.bone = group_of(entry), bone_of(entry)
    if not entry.number:  # of an earlier version's file
        entry.number = numbered(entry.rig, entry.bone)


def numbered(rig, name):
    """The number of a bone, new if it has none or another bone's; 0 if the armature cannot be changed."""
    bones, bone = rig.data.bones, rig.data.bones[name]
    first = next(one for one in bones if getattr(one, BONE_NUMBER) == getattr(bone, BONE_NUMBER))
    if getattr(bone, BONE_NUMBER) and first == bone:
        return getattr(bone, BONE_NUMBER)
    if rig.data.library is not None or rig.data.override_library is not None:
        return 0
    setattr(bone, BONE_NUMBER, 1 + max(getattr(one, BONE_NUMBER) for one in bones))
    return getattr(bone, BONE_NUMBER)


def box_now(entry, where=matrix_of):
    """(4, 4) cube [-1, 1]³ → world, of a handle's present box."""
    if entry.kind == "BONE":
        name = bone_of(entry)
        return where(entry.rig, name) @ bone_box(entry.rig.data.bones[name])
    return current_box(entry.empty, where)


def bone_box(bone):
    """(4, 4) cube [-1, 1]³ → a bone's own coordinates: as long as the bone, as wide as its envelope."""
    half_width = max(bone.envelope_distance + (bone.head_radius + bone.tail_radius) / 2, 0.2 * bone.length)
    box = np.diag([half_width, bone.length / 2, half_width, 1.0])
    box[1, 3] = bone.length / 2
    return box


def is_own(entry):
    """Whether no other object owns an entry's Empty: duplicates of a source have the same Empties."""
    owner = settings_of(entry.empty).handle_of
    return owner in (None, entry.id_data) or not in_scene(owner) or not has_handle(owner, entry.empty)


def is_copied(entry):
    """Whether an entry came with a duplicate of its object, and its Empty is the first's: it is no handle
    until the first is deleted."""
    return entry.kind != "BONE" and in_scene(entry.empty) and not is_own(entry)


def has_mover(entry):
    if entry.kind != "BONE":
        return in_scene(entry.empty) and is_own(entry)
    return in_scene(entry.rig) and entry.rig.pose is not None and bone_of(entry) in entry.rig.pose.bones


def mover_of(entry):
    """The object that moves a handle: its Empty, or its bone's armature."""
    return entry.rig if entry.kind == "BONE" else entry.empty


def name_of(entry):
    return bone_of(entry) if entry.kind == "BONE" else entry.empty.name


USER_SETTINGS = ("weight", "hold_from", "reach", "allow_scale")


def user_settings(entry):
    """{property: value} of a handle's user settings."""
    return {name: getattr(entry, name) for name in USER_SETTINGS}


def put_user_settings(entry, values):
    for name, value in values.items():
        setattr(entry, name, value)


def key_of(entry):
    """Key of a source's handle, unaffected by its renaming and by the removal of others."""
    return mover_of(entry).session_uid, bone_of(entry) if entry.kind == "BONE" else ""
