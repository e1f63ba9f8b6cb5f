# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender has evaluated of the scene.

`context.evaluated_depsgraph_get()` crashes where a script's temp_override() is in force: up to Python 3.11 it
reads that without Python's lock while a worker has it. The window's own events are never in one.
"""

import bpy


def depsgraph_of(context):
    """What Blender has evaluated last; nothing is evaluated for it."""
    return context.view_layer.depsgraph or updated(context.view_layer)


def updated(layer):
    """A view layer's depsgraph, evaluated anew where anything has changed."""
    layer.update()
    return layer.depsgraph


def is_disabled(item):
    """Whether Blender leaves an object of the file as it is, and after a load at the origin: disabled in
    viewports, by itself or with all its collections, or left out of the view layer."""
    layer = bpy.context.view_layer
    if item.visible_get(view_layer=layer):
        return False
    homes = set(item.users_collection)
    return item.hide_viewport or not any(one in homes for one in enabled(layer.layer_collection))


def enabled(layer_collection):
    """The collections of a view layer, from that one down, whose objects Blender evaluates."""
    if layer_collection.collection.hide_viewport:
        return
    if not layer_collection.exclude:
        yield layer_collection.collection
    for child in layer_collection.children:
        yield from enabled(child)


def world_matrix(item):
    """Where an object is, also where Blender leaves it as it is."""
    return item.matrix_world if item.is_evaluated or not is_disabled(item) else own_matrix(item)


def own_matrix(item):
    """The world matrix of an object by its own transforms and its parents', while nothing else moves it."""
    if is_moved(item):
        return item.matrix_world
    if item.parent is None:
        return item.matrix_basis
    return world_matrix(item.parent) @ item.matrix_parent_inverse @ item.matrix_basis


def is_moved(item):
    """Whether an object's place is more than what its own transforms and its parent's say."""
    return is_driven(item) or (item.parent is not None and item.parent_type != "OBJECT")


def is_driven(item):
    """Whether keys, drivers or constraints may move an object."""
    data = item.animation_data
    return bool(item.constraints or (data and (data.action or data.drivers or data.nla_tracks)))


def is_animated(item):
    """Whether keys, drivers or constraints may move an object, or what it is a child of."""
    return is_driven(item) or (item.parent is not None and is_animated(item.parent))
