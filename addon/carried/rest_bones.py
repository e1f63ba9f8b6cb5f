# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits the rest bones of a source's armatures to a wrap by its field; the old rest pose can be restored."""

import json
from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Vector

from ..blender import modifier_stack
from ..blender.object_references import ObjectReference, in_scene, settings_of
from ..core.errors import UserError, refuse
from ..core.geometry import spaces
from ..core.geometry.spaces import inverse, transform
from ..handles.movers import matrix_of, numbered
from ..names import BONE_NUMBER

LEAST_BONE = 1e-5  # of the object's size; Blender deletes zero-length bones


def armatures_of(source):
    """The armatures that pose a source, except those that it carries."""
    carried = [entry.item for entry in settings_of(source).carried]
    posing = [m.object for m in source.modifiers if modifier_stack.is_posing(source, m) and m.show_viewport]
    return [rig for rig in dict.fromkeys(posing) if rig not in carried]


def above_field(source):
    """The armatures whose modifiers come after a source's field."""
    return armatures_of(source) if settings_of(source).under_rig else []


def posed_with(source):
    """The source, and its carried meshes that the same armatures pose."""
    worn = [entry.item for entry in settings_of(source).carried]
    worn = [item for item in worn if in_scene(item) and item.type == "MESH" and item.library is None]
    rigs = {*armatures_of(source)}
    return [source, *(item for item in worn if rigs & {*armatures_of(item)})]


def refusal(rig):
    """UserError that says why an armature's bones cannot be fitted; else None."""
    if rig.library is not None or rig.data.library is not None or rig.override_library is not None:
        return UserError("The bones of {rig} stay: it is linked from another file", rig=rig.name)
    if rig.mode == "EDIT":
        return UserError("The bones of {rig} stay: it is in Edit Mode", rig=rig.name)
    if bpy.context.view_layer.objects.get(rig.name) != rig:
        return UserError("The bones of {rig} stay: it is not in the view layer", rig=rig.name)
    return None


class Fitting:
    """Fits the bones of a source's armatures to one wrap. `warnings`: which of them stay, and why."""

    def __init__(self, source, space):
        self.warnings, self.rigs, self.moved = [], [], []
        for rig in armatures_of(source):
            reason = refusal(rig)
            if reason is not None:
                self.warnings.append(reason)
            elif rig.data.bones:
                self.rigs.append((ObjectReference(rig), *resting(rig), space.world_to_solve @ matrix_of(rig)))

    def move(self, field):
        """Computes the new rest pose of the bones; on a worker."""
        self.moved = []
        for reference, names, poses, lengths, to_solve in self.rigs:
            points = spaces.bone_points(poses, lengths)
            before = transform(to_solve, points)
            after = field(before)
            if not np.isfinite(after).all():
                raise UserError("The result has bones at invalid locations; try other settings")
            posed = spaces.bone_poses(to_solve @ poses, before, after)
            heads, tails = after[0 :: len(spaces.BONE_POINTS)], after[1 :: len(spaces.BONE_POINTS)]
            back = inverse(to_solve)
            axes = posed[:, :3, 2] @ back[:3, :3].T
            self.moved.append((reference, names, transform(back, heads), transform(back, tails), axes))

    def put(self, context):
        """Writes the new rest pose to the armatures; on the main thread."""
        for reference, names, heads, tails, axes in self.moved:
            rig = reference.get()
            if not settings_of(rig).rest_bones:
                rest = {name: [*ends, numbered(rig, name)] for name, ends in rest_of(rig).items()}
                settings_of(rig).rest_bones = json.dumps(rest)
            write(context, rig, dict(zip(names, zip(heads, tails, axes, strict=True), strict=True)))


def rest_of(rig):
    """{name: [head, tail, z axis]} of the bones at rest, in the armature's coordinates."""
    return {
        bone.name: [list(bone.head_local), list(bone.tail_local), list(bone.matrix_local.col[2][:3])]
        for bone in rig.data.bones
    }


def noted(rig):
    """The same for the stored rest pose from before any fit, by the bones' present names."""
    names = {getattr(bone, BONE_NUMBER): bone.name for bone in reversed(rig.data.bones)}
    known = json.loads(settings_of(rig).rest_bones or "{}")
    numbers = {name: ends[3] if ends[3:] else 0 for name, ends in known.items()}
    return {names.get(numbers[name] or None, name): ends[:3] for name, ends in known.items()}


def resting(rig):
    """(names, (k, 4, 4) poses, (k) lengths) of the bones as they were before any fit."""
    ends = rest_of(rig) | noted(rig)
    names = [bone.name for bone in rig.data.bones]
    poses, lengths = np.tile(np.eye(4), (len(names), 1, 1)), []
    for pose, name in zip(poses, names, strict=True):
        head, tail, z = np.array(ends[name], dtype=np.float64)
        y = (tail - head) / np.linalg.norm(tail - head)
        x = np.cross(y, z)
        x /= np.linalg.norm(x)
        pose[:3, :3], pose[:3, 3] = np.stack([x, y, np.cross(x, y)], axis=1), head
        lengths.append(np.linalg.norm(tail - head))
    return names, poses, lengths


def write(context, rig, ends):
    """Writes {name: (head, tail, z axis)} to the rest bones; skips names without a bone."""
    least = LEAST_BONE * max(np.ptp([end for head, tail, _ in ends.values() for end in (head, tail)], axis=0))
    with edit_bones(context, rig) as bones:
        for name, (head, tail, _) in ends.items():
            if name in bones and np.linalg.norm(np.subtract(tail, head)) > least:
                bones[name].head, bones[name].tail = head, tail
        for name, (_, _, z) in ends.items():
            if name in bones:
                bones[name].align_roll(Vector(z))


def fitted(source):
    """The armatures of a source whose rest bones were fitted."""
    return [rig for rig in armatures_of(source) if settings_of(rig).rest_bones]


def reset(context, source):
    """Restores the rest pose from before any fit in a source's armatures."""
    for rig in fitted(source):
        refuse(refusal(rig))
        write(context, rig, noted(rig))
        settings_of(rig).rest_bones = ""


class BeforeArmatures:
    """Moves the field's modifier before a source's armatures for one wrap; moves it back if that fails."""

    def __init__(self, source):
        stack, first = list(source.modifiers), modifier_stack.first_posing(source)
        if first < modifier_stack.earliest(stack):
            last = stack[modifier_stack.earliest(stack) - 1].name
            raise UserError("{name}: move its armature behind {modifier}", source, modifier=last)
        self.source = ObjectReference(source)
        self.was, self.index, self.kept = settings_of(source).under_rig, None, False
        settings_of(source).under_rig = True
        modifier = modifier_stack.find(source)
        if modifier is None:
            return
        index = source.modifiers.find(modifier.name)
        if first < index:
            self.index = index
            source.modifiers.move(index, first)

    def give_back(self):
        source = self.source.find()
        if source is None or self.kept:
            return
        settings_of(source).under_rig = self.was
        modifier = modifier_stack.find(source)
        if modifier is not None and self.index is not None:
            source.modifiers.move(source.modifiers.find(modifier.name), self.index)


@contextmanager
def edit_bones(context, rig):
    """Context manager: the armature's edit bones; restores the active object, selection and visibility."""
    layer = context.view_layer
    active = layer.objects.active
    mode = active.mode if active is not None else "OBJECT"
    seen = rig.hide_viewport, rig.hide_get(), rig.data.use_mirror_x
    if mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    rig.hide_viewport = False
    rig.hide_set(False)
    rig.data.use_mirror_x = False
    layer.objects.active = rig
    try:
        bpy.ops.object.mode_set(mode="EDIT")
        try:
            yield rig.data.edit_bones
        finally:
            bpy.ops.object.mode_set(mode="OBJECT")
    finally:
        rig.data.use_mirror_x = seen[2]
        rig.hide_set(seen[1])
        rig.hide_viewport = seen[0]
        layer.objects.active = active
        if mode != "OBJECT":
            bpy.ops.object.mode_set(mode=mode)
