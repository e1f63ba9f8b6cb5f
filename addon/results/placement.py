# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solve made goes where the user wants it: a modifier, a new object, the mesh itself, a shape key."""

import json
from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import mesh_arrays, modifier_stack
from ..blender.object_references import settings_of
from ..blender.property_definitions import effective_value
from ..blender.splat_layouts import holds_splats
from ..core.errors import UserError, refuse
from ..core.geometry.edges import Topology
from ..core.geometry.spaces import space_of
from ..field_modifier import armatures, layers, motion
from ..handles import empties
from ..names import REPORT
from . import result_objects


@dataclass
class SolvedMesh:
    """What the worker hands back, in local coordinates."""

    vertices: np.ndarray
    topology: Topology | None  # of the implicit surface; None for the source's own mesh
    report: dict
    turns: np.ndarray | None = None  # (n, 3) axis · angle, for free custom normals
    changes: dict | None = None  # of splats' attributes
    carried: list = field(default_factory=list)  # what Carrying.moved made
    place: np.ndarray | None = None  # (4, 4) local → world: where the object itself goes, if it does


def destination(settings, operator):
    """(output, result) of a call: what is made, where it goes; `target` is the earlier name of the latter."""
    given = operator.properties.is_property_set
    name = "target" if given("target") and not given("result") else "result"
    output = effective_value("output", settings, operator)
    return output, effective_result(output, effective_value(name, settings, operator))


def placement_refusal(source):
    """Why a result cannot go where the object's settings say, as a UserError; None where it can."""
    settings = settings_of(source)
    return refusal(source, settings.output, effective_result(settings.output, settings.result))


def replaced_by(source, kind):
    """The UserError that says which result a run of that kind replaces; None where nothing is lost."""
    is_lost = not settings_of(source).live_kind and settings_of(source).result != "NEW"
    return layers.replaced(source, kind) if is_lost else None


def effective_result(output, result):
    """Where a result goes: surfaces, which no modifier can make of the mesh, go to a new object."""
    return "NEW" if result == "MODIFIER" and output != "WARP" else result


def keeps_mesh(output, result):
    """Whether the source's own vertices take the result as a modifier."""
    return output == "WARP" and result == "MODIFIER"


def in_place(output, result):
    """Whether the shape that is worked on is that at the modifier's place, rather than all that is shown."""
    return output == "WARP" and result != "NEW"


def place_result(context, source, kind, output, result, moved, before):
    """Puts `moved`, a SolvedMesh, where `result` says; `before` are the vertices at rest."""
    if result == "NEW":
        return new_object(context, source, kind, output, moved, before)
    refuse(refusal(source, output, result))
    if keeps_mesh(output, result):
        motion.bind(context, source, len(before))
        motion.write(source, motion.Motion(moved.vertices - before, moved.turns, moved.changes))
        layers.note(source, kind)
        source[REPORT] = json.dumps(moved.report)
        return source
    if moved.topology is None and len(source.data.vertices) != len(before):
        raise UserError("{name} changed while it was worked on; run again", source)
    if moved.topology is not None:
        mesh = result_objects.surface_mesh(source, moved.vertices, moved.topology)
        old, source.data = source.data, mesh
        if old.users == 0:
            bpy.data.meshes.remove(old)
    elif result == "KEY" or source.data.shape_keys is not None:
        single_user(source)
        if source.data.shape_keys is None:
            source.shape_key_add(name="Basis", from_mix=False)
        result_objects.add_warp_key(source, before, moved.vertices)
    else:
        single_user(source)
        mesh_arrays.set_positions(source.data, moved.vertices)
    armatures.silence(source)
    motion.discard(source)  # what it moved is part of the mesh now
    if source.data.shape_keys is None:
        layers.discard(source)
    layers.uncover(source)
    source[REPORT] = json.dumps(moved.report)
    if result == "REPLACE":
        for entry in empties.used(source):
            empties.store_rest(source, entry)
    return source


def holds_place(source, target):
    """Whether its place in the world is not its own to change: something else sets it or refers to it, or
    the target of its wrap goes along."""
    settings, data = settings_of(source), source.animation_data
    bound = source.constraints or settings.carried or empties.used(source)
    posed = any(modifier.type == "ARMATURE" for modifier in source.modifiers)
    moved = data is not None and (data.action or data.drivers or data.nla_tracks)
    parent = source.parent
    sheared = parent is not None and not np.array_equal(
        space_of(parent.matrix_world).local_to_solve, np.eye(4)
    )
    return bool(bound or posed or moved or sheared or hangs_on(target, source))


def hangs_on(item, other):
    """Whether an object is a child of another, or a child's child."""
    while item is not None and item.parent != other:
        item = item.parent
    return item is not None


def put(context, item, place):
    """Puts an object where a matrix, (4, 4) local → world, says, wherever it was moved meanwhile."""
    item.matrix_world = Matrix(place.tolist())
    context.view_layer.update()


def new_object(context, source, kind, output, moved, before):
    if moved.topology is not None:
        mesh = result_objects.surface_mesh(source, moved.vertices, moved.topology)
    else:
        mesh = result_objects.warp_mesh(context, source, before, moved.vertices)
    item = result_objects.show(context, source, kind, output, mesh, moved.report)
    if mesh.shape_keys is not None:
        result_objects.add_warp_key(item, before, moved.vertices)
    return item


def refusal(source, output, result):
    """Why the source itself cannot take the result, as a UserError; None where it can."""
    if not keeps_mesh(output, result) and holds_splats(source):
        return UserError(
            "{name} holds splats; choose Original Mesh as geometry, Modifier for the result", source
        )
    if result == "NEW":
        return None
    if keeps_mesh(output, result):
        reason = motion.refusal(source)
    elif source.library is not None or source.data.library is not None:
        reason = UserError("{name} is linked from another file; choose New Object for the result", source)
    else:
        reason = None
    if reason is None and result == "REPLACE" and settings_of(source).carried:
        reason = UserError("{name} carries other objects; choose Modifier for the result", source)
    if reason is None and output != "WARP" and result == "KEY":
        reason = UserError("A shape key keeps the mesh; choose Original Mesh as its geometry")
    if reason is None and output == "WARP" and not keeps_mesh(output, result):
        reason = refusal_of_stack(source)
    return reason


def refusal_of_stack(source):
    """Why the mesh itself cannot take moved vertices, as a UserError; None where it can."""
    if result_objects.keeps_vertices(source, in_place=True):
        return None
    names = [modifier.name for modifier in modifier_stack.shown_before(source, in_place=True)]
    if not names:
        return UserError("{name} shows one shape key alone, or absolute ones; choose Modifier", source)
    return UserError(
        "{name} has modifiers that change its vertices before ({modifiers}); apply them, "
        "or choose Modifier for the result",
        source,
        modifiers=", ".join(names),
    )


def single_user(source):
    """A mesh of its own: other objects that share it stay as they are."""
    if source.data.users > 1:
        source.data = source.data.copy()
