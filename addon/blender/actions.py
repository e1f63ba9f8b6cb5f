# SPDX-License-Identifier: GPL-3.0-or-later
"""F-curves of actions, in all supported versions of Blender, and values without keyframes."""

import contextlib

import bpy

from .evaluation import updated
from .references import put_at

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
