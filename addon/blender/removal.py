# SPDX-License-Identifier: GPL-3.0-or-later
"""Taking away what the extension made, together with what nothing else uses then."""

import bpy


def remove_mesh_object(item):
    """The object, its mesh, and the animation of the mesh's shape keys."""
    mesh = item.data
    keys = mesh.shape_keys
    action = keys.animation_data.action if keys is not None and keys.animation_data else None
    bpy.data.objects.remove(item)
    if mesh.users == 0:
        bpy.data.meshes.remove(mesh)
    if action is not None and action.users == 0:
        bpy.data.actions.remove(action)


def remove_node_modifier(modifier):
    """A Geometry Nodes modifier, and its node group."""
    group = modifier.node_group
    modifier.id_data.modifiers.remove(modifier)
    if group.users == 0:
        bpy.data.node_groups.remove(group)
