# SPDX-License-Identifier: GPL-3.0-or-later
"""F-curves of actions, in all supported versions of Blender."""

import bpy


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
