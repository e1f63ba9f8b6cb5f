# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solve made goes where the user wants it: a modifier, a new object, the mesh itself, a shape key."""

import json

import bpy

from ..blender import mesh_arrays, modifier_stack
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..field_modifier import armatures, motion
from ..handles import empties
from ..names import REPORT
from . import result_objects


def effective_target(output, target):
    """Where a result goes: surfaces, which no modifier can make of the mesh, go to a new object."""
    return "NEW" if target == "MODIFIER" and output != "WARP" else target


def keeps_mesh(output, target):
    """Whether the source's own vertices take the result as a modifier."""
    return output == "WARP" and target == "MODIFIER"


def in_place(output, target):
    """Whether the shape that is worked on is that at the modifier's place, rather than all that is shown."""
    return output == "WARP" and target != "NEW"


def place_result(context, source, kind, output, target, moved, before):
    """Puts `moved`, a SolvedMesh, where `target` says; `before` are the vertices at rest."""
    if target == "NEW":
        return new_object(context, source, kind, output, moved, before)
    reason = refusal(source, output, target)
    if reason is not None:
        raise reason
    if keeps_mesh(output, target):
        motion.bind(context, source)
        motion.write(source, motion.Motion(moved.vertices - before, moved.turns))
        source[REPORT] = json.dumps(moved.report)
        return source
    if moved.topology is None and len(source.data.vertices) != len(before):
        raise UserError("{name} changed while it was worked on; run again", name=source.name)
    if moved.topology is not None:
        mesh = result_objects.surface_mesh(source, moved.vertices, moved.topology)
        old, source.data = source.data, mesh
        if old.users == 0:
            bpy.data.meshes.remove(old)
    elif target == "KEY" or source.data.shape_keys is not None:
        single_user(source)
        if source.data.shape_keys is None:
            source.shape_key_add(name="Basis", from_mix=False)
        result_objects.add_warp_key(source, before, moved.vertices)
    else:
        single_user(source)
        mesh_arrays.set_positions(source.data, moved.vertices)
    armatures.silence(source)
    motion.discard(source)  # what it moved is part of the mesh now
    source[REPORT] = json.dumps(moved.report)
    if target == "REPLACE":
        for entry in empties.used(source):
            empties.store_rest(source, entry)
    return source


def new_object(context, source, kind, output, moved, before):
    if moved.topology is not None:
        mesh = result_objects.surface_mesh(source, moved.vertices, moved.topology)
    else:
        mesh = result_objects.warp_mesh(context, source, before, moved.vertices)
    item = result_objects.show(context, source, kind, output, mesh, moved.report)
    if mesh.shape_keys is not None:
        result_objects.add_warp_key(item, before, moved.vertices)
    return item


def refusal(source, output, target):
    """Why the source itself cannot take the result, as a UserError; None where it can."""
    if target == "NEW":
        return None
    if keeps_mesh(output, target):
        reason = motion.refusal(source)
    elif source.library is not None or source.data.library is not None:
        reason = UserError(
            "{name} is linked from another file; choose New Object for the result", name=source.name
        )
    else:
        reason = None
    if reason is None and target == "REPLACE" and settings_of(source).carried:
        reason = UserError("{name} carries other objects; choose Modifier for the result", name=source.name)
    if reason is None and output != "WARP" and target == "KEY":
        reason = UserError("a shape key keeps the mesh; choose Original Mesh for the output")
    if reason is None and output == "WARP" and not keeps_mesh(output, target):
        reason = refusal_of_stack(source)
    return reason


def refusal_of_stack(source):
    """Why the mesh itself cannot take moved vertices, as a UserError; None where it can."""
    if result_objects.keeps_vertices(source, in_place=True):
        return None
    names = [modifier.name for modifier in modifier_stack.shown_before(source, in_place=True)]
    if not names:
        return UserError(
            "{name} shows one shape key alone, or absolute ones; choose Modifier", name=source.name
        )
    return UserError(
        "{modifiers} of {name} change its vertices before; apply them, or choose Modifier for the result",
        modifiers=", ".join(names),
        name=source.name,
    )


def single_user(source):
    """A mesh of its own: other objects that share it stay as they are."""
    if source.data.users > 1:
        source.data = source.data.copy()
