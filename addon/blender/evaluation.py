# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's depsgraph, evaluated world matrices, and the F-curves and keyframes that move objects."""

import contextlib

import bpy

from .references import put_at

# The depsgraph of the scene, and evaluated world matrices.
#
# `context.evaluated_depsgraph_get()` crashes within a script's temp_override(): up to Python 3.11 it reads
# the override without the GIL while a worker holds it. The window's own events never have an override.


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


# F-curves of actions, in all supported versions of Blender, and values without keyframes.

# F-curves of actions, in all supported versions of Blender.


def bags_of(action):
    """The owners of an action's F-curves: from Blender 4.4 on the channel bags of its layers' strips."""
    for layer in getattr(action, "layers", ()):
        for strip in layer.strips:
            yield from getattr(strip, "channelbags", ())
    if hasattr(action, "fcurves"):
        yield action


def remove_curves(owner, is_removed):
    """Removes the F-curves of the owner's action for which `is_removed(curve)` is true, and the action if it
    is empty then."""
    action = owner.animation_data.action if owner.animation_data is not None else None
    if action is None:
        return
    removed, left = 0, 0
    for bag in bags_of(action):
        for curve in list(bag.fcurves):
            if is_removed(curve):
                bag.fcurves.remove(curve)
                removed += 1
        left += len(bag.fcurves)
    if removed and not left:
        owner.animation_data.action = None
        if action.users == 0:
            bpy.data.actions.remove(action)


def own_action(owner):
    """Makes the action of a copied data-block single-user, if it has one."""
    data = owner.animation_data
    if data is not None and data.action is not None:
        data.action = data.action.copy()


def has_keys(item, path):
    """Whether an object's own action has F-curves whose data path starts with `path`."""
    data = item.animation_data
    action = data.action if data is not None else None
    return action is not None and any(curve.data_path.startswith(path) for curve in curves_of(action))


def varies(item, path):
    """Whether an object's own action, or a driver, moves a property whose data path starts with `path`."""
    drivers = item.animation_data.drivers if item.animation_data is not None else ()
    return has_keys(item, path) or any(driver.data_path.startswith(path) for driver in drivers)


def curves_of(action):
    """An action's F-curves, of all slots."""
    for bag in bags_of(action):
        yield from bag.fcurves


def pace(scene):
    """Animation frames per scene frame, by the render settings' Time Stretching; 1 by default."""
    return scene.render.frame_map_old / scene.render.frame_map_new


def key_at(owner, path, frame, **given):
    """Inserts a keyframe that takes effect at a frame of the scene, whatever its Time Stretching."""
    owner.keyframe_insert(path, frame=frame * pace(bpy.context.scene), **given)


# Preserves unkeyed values while a temporary scene is evaluated at another frame.
#
# Blender copies the last evaluated values, of any scene, back to the original data-blocks: poses without
# keyframes would be lost.


@contextlib.contextmanager
def kept(context, items):
    """Context manager: restores the animated values of these data-blocks at the end, and evaluates them."""
    before = [(item, path, value_at(item, path)) for item in items for path in keyed(item)]
    try:
        yield
    finally:
        for item, path, value in before:
            if value is not None and value_at(item, path) != value:
                put_at(item, path, value)
        for item in items:
            item.update_tag()
        if items:
            updated(context.view_layer)


def keyed(item):
    """The data paths of a data-block's F-curves, in its action and NLA strips."""
    data = getattr(item, "animation_data", None)
    if data is None:
        return set()
    strips = [strip.action for track in data.nla_tracks for strip in track.strips]
    actions = [action for action in (data.action, *strips) if action is not None]
    return {curve.data_path for action in actions for curve in curves_of(action)}


def value_at(item, path):
    """A copy of the value at a data path; None if the path is invalid."""
    try:
        value = item.path_resolve(path)
    except ValueError:
        return None
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value
