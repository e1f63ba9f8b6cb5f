# SPDX-License-Identifier: GPL-3.0-or-later
"""The armature and the meshes to skin, checks for both, and native bones of the armature."""

from contextlib import contextmanager

import numpy as np

from ..blender import modifier_stack, object_references
from ..core.errors import UserError

# Radians: largest joint limit, and the limit of an axis without one if other axes have some.
WIDEST, FREE = np.radians(60.0), np.radians(25.0)


def rig_of(context):
    """The armature: the active or a selected object, else the one that the active mesh follows; or None."""
    active, selected = object_references.active_of(context), context.selected_objects
    found = next((item for item in (active, *selected) if item and item.type == "ARMATURE"), None)
    if found is None and active is not None and active.type == "MESH":
        found = next((rig for rig in followed(active)), None)
    return found


def followed(item):
    """The armatures that deform a mesh object, by a modifier or as its parent."""
    rigs = [rig for rig in map(modifier_stack.rig_of, item.modifiers) if rig is not None]
    return rigs + ([item.parent] if is_posed_by_parent(item) else [])


def is_posed_by_parent(item):
    return item.parent is not None and item.parent.type == "ARMATURE" and item.parent_type == "ARMATURE"


def meshes_of(context, rig, scope):
    """The mesh objects to skin; objects of handles and results are left out."""
    within = context.selected_objects
    if scope == "COLLECTION":
        within = [item for home in rig.users_collection for item in home.all_objects]
    found = [item for item in dict.fromkeys(within) if item.type == "MESH"]
    return [item for item in found if object_references.owner_of(item) is None]


def refusal(rig, meshes):
    """UserError that says why these meshes cannot be skinned; else None."""
    if rig is None or not meshes:
        return UserError("Select the meshes, then the armature")
    if not rig.data.bones:
        return UserError("The armature {rig} has no bones to pose", rig=rig.name)
    if not any(bone.use_deform for bone in rig.data.bones):
        return UserError("No bone of {rig} deforms", rig=rig.name)
    if rig.mode == "EDIT":
        return UserError("{name} is in Edit Mode; leave it first", rig)
    return next(filter(None, (refusal_of(rig, item) for item in meshes)), None)


def refusal_of(rig, item):
    """UserError that says why a mesh cannot be skinned; else None."""
    reason = object_references.refusal(item)
    if reason is not None:
        return reason
    if item.library is not None or item.data.library is not None:
        return UserError("{name} is linked from another file; make it local first", item)
    if rig in modifier_stack.handle_rigs(item):
        return UserError("The bones of {name} are handles of {source}", rig, source=item.name)
    if item.parent == rig and item.parent_type == "BONE":
        return UserError("{name} moves with a bone already; clear its parent first", item)
    return None


@contextmanager
def at_rest(context, rig):
    """Context manager: sets the armature to its Rest Position."""
    shown = rig.data.pose_position
    rig.data.pose_position = "REST"
    context.view_layer.update()
    try:
        yield
    finally:
        rig.data.pose_position = shown
        context.view_layer.update()


def bones_of(af, rig):
    """All bones of the armature at rest, in its coordinates, as af.Bone."""
    numbers = {bone.name: index for index, bone in enumerate(rig.data.bones)}
    found = []
    for bone in rig.data.bones:
        parent = numbers[bone.parent.name] if bone.parent else None
        _, roll = bone.AxisRollFromMatrix(bone.matrix_local.to_3x3())
        limits = limits_of(rig.pose.bones[bone.name])
        found.append(
            af.Bone(
                tuple(bone.head_local),
                tuple(bone.tail_local),
                parent,
                roll,
                deform=bone.use_deform,
                limits=limits,
                name=bone.name,
            )
        )
    return found


def rest_of(rig):
    """Comparable rest pose of the bones."""
    return [
        (
            bone.name,
            bone.parent and bone.parent.name,
            bone.use_deform,
            bone.length,
            *map(tuple, bone.matrix_local),
        )
        for bone in rig.data.bones
    ]


def limits_of(bone):
    """(3, 2) lower and upper rotation limit per axis of a pose bone, in radians; None without limits."""
    limits, has_any = np.array([[-FREE, FREE]] * 3), False
    sources = [(bone, "use_ik_limit_{}", "ik_min_{}", "ik_max_{}")]
    sources += [
        (one, "use_limit_{}", "min_{}", "max_{}")
        for one in bone.constraints
        if one.type == "LIMIT_ROTATION" and one.owner_space == "LOCAL" and not one.mute
    ]
    for source, *names in sources:
        for row, axis in zip(limits, "xyz", strict=True):
            used, least, most = (getattr(source, name.format(axis)) for name in names)
            if used:
                has_any, row[:] = True, np.clip((least, most), -WIDEST, WIDEST)
    return limits if has_any else None
