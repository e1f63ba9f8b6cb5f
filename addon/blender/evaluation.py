# SPDX-License-Identifier: GPL-3.0-or-later
"""The depsgraph of the scene, and evaluated world matrices.

`context.evaluated_depsgraph_get()` crashes within a script's temp_override(): up to Python 3.11 it reads the
override without the GIL while a worker holds it. The window's own events never have an override.
"""

import bpy


def depsgraph_of(context):
    """The view layer's depsgraph as evaluated last; does not evaluate it."""
    return context.view_layer.depsgraph or updated(context.view_layer)


def updated(layer):
    """A view layer's depsgraph, evaluated after the last changes."""
    layer.update()
    return layer.depsgraph


def is_disabled(item):
    """Whether Blender does not evaluate an object, which after a load is at the origin: disabled in
    viewports, by itself or with all its collections, or excluded from the view layer."""
    layer = bpy.context.view_layer
    if item.visible_get(view_layer=layer):
        return False
    homes = set(item.users_collection)
    return item.hide_viewport or not any(one in homes for one in enabled(layer.layer_collection))


def enabled(layer_collection):
    """The collections of a view layer whose objects Blender evaluates, from `layer_collection` down."""
    if layer_collection.collection.hide_viewport:
        return
    if not layer_collection.exclude:
        yield layer_collection.collection
    for child in layer_collection.children:
        yield from enabled(child)


def world_matrix(item):
    """An object's world matrix, also if Blender does not evaluate it."""
    return item.matrix_world if item.is_evaluated or not is_disabled(item) else own_matrix(item)


def own_matrix(item):
    """The world matrix of an object by its own transform and its parents', if nothing else moves it."""
    if is_moved(item):
        return item.matrix_world
    if item.parent is None:
        return item.matrix_basis
    return world_matrix(item.parent) @ item.matrix_parent_inverse @ item.matrix_basis


def is_moved(item):
    """Whether an object's world matrix depends on more than its own transform and its parent's."""
    return is_driven(item) or (item.parent is not None and item.parent_type != "OBJECT")


def is_driven(item):
    """Whether keyframes, drivers or constraints may move an object."""
    data = item.animation_data
    return bool(item.constraints or (data and (data.action or data.drivers or data.nla_tracks)))


def is_animated(item):
    """Whether keyframes, drivers or constraints may move an object or one of its ancestors."""
    return any(map(is_driven, with_ancestors(item)))


def with_ancestors(item):
    """Yields the object, its parent, the parent's parent and so on; nothing for None."""
    while item is not None:
        yield item
        item = item.parent
