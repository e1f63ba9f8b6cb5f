# SPDX-License-Identifier: GPL-3.0-or-later
"""Removes objects and modifiers of the extension with the data-blocks that become unused."""

import bpy

from . import undo_steps
from .references import put_at, references


def remove_mesh_object(item):
    """Removes the object, its mesh, and the action of the mesh's shape keys."""
    mesh = item.data
    keys = mesh.shape_keys
    action = keys.animation_data.action if keys is not None and keys.animation_data else None
    bpy.data.objects.remove(item)
    if mesh.users == 0:
        bpy.data.meshes.remove(mesh)
    if action is not None and action.users == 0:
        bpy.data.actions.remove(action)


def remove_modifier(modifier):
    """Removes a modifier; clears its inputs first: Blender 5.2 would keep their data-blocks' users."""
    for path, _ in references(modifier):
        if path.startswith("properties."):
            put_at(modifier, path, None)
    modifier.id_data.modifiers.remove(modifier)


def remove_node_modifier(modifier):
    """Removes a Geometry Nodes modifier, and its node group if that is unused then."""
    group = modifier.node_group
    remove_modifier(modifier)
    remove_unused_group(group)


def remove_unused_group(group):
    if group.users == 0 and not undo_steps.keeps_unused:
        bpy.data.node_groups.remove(group)
