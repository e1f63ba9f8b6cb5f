# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones as handles: the region that a bone holds follows the pose bone."""

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import modifier_stack
from ..blender.object_references import in_scene, settings_of
from ..core.errors import UserError
from . import empties, movers

LEAST_HELD = 4  # least number of samples for a bone without a group: with fewer, other samples may miss it
HOLD_FROM = 0.8  # least weight of a bone's group that is held; between two bones the surface bends freely


def armature_of(context, source):
    """The selected armature, or the one that deforms the mesh; UserError without one."""
    selected = [item for item in context.selected_objects if item.type == "ARMATURE"]
    moved_by = [rig for rig in map(modifier_stack.rig_of, source.modifiers) if in_scene(rig)]
    parents = [source.parent] if source.parent is not None and source.parent.type == "ARMATURE" else []
    rig = next(iter([*selected, *moved_by, *parents]), None)
    if rig is None:
        raise UserError("{name} follows no armature; select one as well", source)
    if rig.pose is None or not len(rig.pose.bones):
        raise UserError("The armature {rig} has no bones to pose", rig=rig.name)
    return rig


def is_selected(rig, name):
    """Whether a bone is selected; Blender 5 stores that in the pose bone."""
    pose = rig.pose.bones[name]
    return pose.select if hasattr(pose, "select") else pose.bone.select


def chosen(rig, which, holding):
    """Names of the bones to make handles of, by the enum BONES; UserError without any.

    `holding`: names of the vertex groups that are not empty.
    """
    names = []
    if which == "SELECTED" or (which == "AUTO" and rig.mode == "POSE"):
        names = [bone.name for bone in rig.pose.bones if is_selected(rig, bone.name)]
    if not names and which != "SELECTED":
        names = [bone.name for bone in rig.data.bones if bone.use_deform]
        names = [name for name in names if name in holding] or names
    if not names:
        raise UserError("No bone of {rig} is selected, or deforms", rig=rig.name)
    return names


def holding_groups(context, source):
    """Names of the groups with a vertex in the shape to solve, including sides made by Mirror modifiers."""
    with modifier_stack.evaluated_mesh(context, source, settings_of(source).in_place) as mesh:
        indices = {entry.group for vertex in mesh.vertices for entry in vertex.groups if entry.weight > 0}
    return {group.name for group in source.vertex_groups if group.index in indices}


def unposed(context, source):
    """UserError that names carried meshes which do not follow all of their bones; else None.

    A carried mesh follows the source only, not bones that only its own vertex groups name.
    """
    handles = {(entry.rig, movers.bone_of(entry)) for entry in settings_of(source).handles if is_bone(entry)}
    rigs, names = {rig for rig, _ in handles if in_scene(rig)}, []
    for entry in settings_of(source).carried:
        item = entry.item
        if not in_scene(item) or item.type != "MESH" or entry.way == "RIGID":
            continue
        own = rigs & set(map(modifier_stack.rig_of, item.modifiers))
        groups = holding_groups(context, item) if own else ()
        bones = [(rig, bone.name) for rig in own for bone in rig.data.bones if bone.use_deform]
        if any(bone[1] in groups and bone not in handles for bone in bones):
            names.append(item.name)
    if not names:
        return None
    return UserError(
        "Bones that {name} has no vertex groups of do not pose {items}; join these with it first (Ctrl J)",
        source,
        items=", ".join(names),
    )


def find(source, rig, name):
    """Index of the bone's handle in the source's list, or -1."""
    entries = enumerate(settings_of(source).handles)
    own = ((index, entry) for index, entry in entries if is_bone(entry) and entry.rig == rig)
    return next((index for index, entry in own if movers.bone_of(entry) == name), -1)


def is_bone(entry):
    """Whether a handle is a bone of an existing armature."""
    return entry.kind == "BONE" and entry.rig is not None


def add(source, rig, name, groups):
    """Makes a bone a handle of the source, with the rest bone as rest pose; resets an existing one.

    `groups`: names of the vertex groups that are not empty.
    """
    index = find(source, rig, name)
    entry = empties.choose_or_add(settings_of(source), index)
    entry.kind, entry.rig, entry.bone = "BONE", rig, name
    entry.number = movers.numbered(rig, name)
    if index < 0:
        entry.group = name if name in groups else ""
        entry.hold_from = HOLD_FROM
    entry.rest = (np.linalg.inv(empties.matrix_of(source)) @ rest_in_world(rig, name)).ravel()
    return entry


def keep_holding(source, rig, names):
    """Removes handles of bones that hold nothing; returns the other names, UserError without any."""
    held = []
    for name in names:
        index = find(source, rig, name)
        entry = settings_of(source).handles[index]
        if entry.group or entry.inside >= LEAST_HELD:
            held.append(name)
        else:
            empties.remove(source, index)
    if not held:
        raise UserError("No bone of {rig} is near the surface of {name}", source, rig=rig.name)
    return held


def rest_in_world(rig, name):
    """(4, 4) cube [-1, 1]³ → world, of a bone at rest."""
    bone = rig.data.bones[name]
    return empties.matrix_of(rig) @ np.array(bone.matrix_local, dtype=np.float64) @ movers.bone_box(bone)


def mirror(context, source, entry):
    """Makes a handle of the mirrored bone, with the same settings."""
    bone = movers.bone_of(entry)
    name = bpy.utils.flip_name(bone)
    if name == bone or name not in entry.rig.data.bones:
        raise UserError(
            "The armature {rig} has no bone on the other side of {bone}", rig=entry.rig.name, bone=bone
        )
    kept = movers.user_settings(entry)
    movers.put_user_settings(add(source, entry.rig, name, holding_groups(context, source)), kept)


def reset(context, source, entries):
    """Poses the bones of these handles as they were at rest, parents first."""
    named = [(entry, movers.bone_of(entry)) for entry in entries]
    for entry, name in sorted(named, key=lambda one: len(one[0].rig.data.bones[one[1]].parent_recursive)):
        box = movers.bone_box(entry.rig.data.bones[name])
        target = np.linalg.inv(empties.matrix_of(entry.rig)) @ empties.rest_box(source, entry)
        entry.rig.pose.bones[name].matrix = Matrix((target @ np.linalg.inv(box)).tolist())
        context.view_layer.update()
