# SPDX-License-Identifier: GPL-3.0-or-later
"""Places a solve's result: in the modifier, a new object, the mesh itself, or a shape key."""

import json
from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import is_driven, with_ancestors
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
    """Result of a solve on the worker, in local coordinates."""

    vertices: np.ndarray
    topology: Topology | None  # of the implicit surface; None for the source's own mesh
    report: dict
    turns: np.ndarray | None = None  # (n, 3) rotation vectors (axis · angle), for free custom normals
    changes: dict | None = None  # the splats' changed attributes
    carried: list = field(default_factory=list)  # [(CarriedObject, shape)] by Carrying.moved
    place: np.ndarray | None = None  # (4, 4) new world matrix of the object, if it is moved


def destination(settings, operator):
    """(output, result) of an operator call; `target` is the earlier name of `result`."""
    given = operator.properties.is_property_set
    name = "target" if given("target") and not given("result") else "result"
    output = effective_value("output", settings, operator)
    return output, effective_result(output, effective_value(name, settings, operator))


def placement_refusal(source):
    """UserError that says why the result of the object's settings cannot be placed; else None."""
    settings = settings_of(source)
    return refusal(source, settings.output, effective_result(settings.output, settings.result))


def replaced_by(source, kind):
    """UserError that says which result a run of that kind replaces; else None."""
    is_lost = not settings_of(source).live_kind and settings_of(source).result != "NEW"
    return layers.replaced(source, kind) if is_lost else None


def effective_result(output, result):
    """`result`, but NEW for implicit surfaces, which the modifier cannot make of the mesh."""
    return "NEW" if result == "MODIFIER" and output != "WARP" else result


def keeps_mesh(output, result):
    """Whether the result is the source's modifier, which leaves its mesh as it is."""
    return output == "WARP" and result == "MODIFIER"


def in_place(output, result):
    """Whether a solve reads the mesh at the modifier's place in the stack, not after all modifiers."""
    return output == "WARP" and result != "NEW"


def place_result(context, source, kind, output, result, moved, before):
    """Places `moved`, a SolvedMesh, by `result`; `before`: (n, 3) vertices at rest."""
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
    motion.discard(source)  # the mesh contains its motion now
    if source.data.shape_keys is None:
        layers.discard(source)
    layers.uncover(source)
    source[REPORT] = json.dumps(moved.report)
    if result == "REPLACE":
        for entry in empties.used(source):
            empties.store_rest(source, entry)
    return source


def holds_place(source, target):
    """Whether the source's transform must stay: because animation, constraints, handles, armatures or a
    sheared parent depend on it, or the target of its wrap is its child."""
    bound = is_driven(source) or settings_of(source).carried or empties.used(source)
    posed = any(modifier.type == "ARMATURE" for modifier in source.modifiers)
    parent = source.parent
    sheared = parent is not None and not np.array_equal(
        space_of(parent.matrix_world).local_to_solve, np.eye(4)
    )
    return bool(bound or posed or sheared or source in with_ancestors(target))


def put(context, item, place):
    """Sets an object's world matrix to (4, 4) `place`, even if the object was moved meanwhile."""
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
    """UserError that says why the source itself cannot take the result; else None."""
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
    """UserError that says why the mesh itself cannot take moved vertices; else None."""
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
    """Makes the source's mesh single-user, so that other objects keep theirs."""
    if source.data.users > 1:
        source.data = source.data.copy()
