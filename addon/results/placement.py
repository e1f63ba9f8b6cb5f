# SPDX-License-Identifier: GPL-3.0-or-later
"""What a solve made goes where the user wants it: a new object, the source itself, or a shape key of it."""

import json

import bpy

from ..blender import mesh_arrays
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..handles import empties
from ..names import REPORT
from . import result_objects


def place_result(context, source, kind, output, target, moved, before):
    """Puts `moved` (vertices, topology, report) where `target` says; `before` are the vertices as shown."""
    if target == "NEW":
        return new_object(context, source, kind, output, moved, before)
    require_placeable(source, output, target, before)
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


def require_placeable(source, output, target, before):
    """UserError where the source itself cannot take the result."""
    if source.library is not None or source.data.library is not None:
        raise UserError(
            "{name} is linked from another file; choose New Object for the result", name=source.name
        )
    if settings_of(source).live_display:
        raise UserError("{name} is live; end live mode first", name=source.name)
    if output != "WARP" and target == "KEY":
        raise UserError("a shape key keeps the mesh; choose Original Mesh for the output")
    if output == "WARP" and not result_objects.keeps_vertices(source, source.data, before):
        raise UserError(
            "modifiers of {name} change its vertices; apply them, or choose New Object for the result",
            name=source.name,
        )


def single_user(source):
    """A mesh of its own: other objects that share it stay as they are."""
    if source.data.users > 1:
        source.data = source.data.copy()
