# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves of actions, in all versions of Blender."""

import bpy


def bags_of(action):
    """What holds an action's curves: from Blender 4.4 on the channel bags of its layers' strips."""
    for layer in getattr(action, "layers", ()):
        for strip in layer.strips:
            yield from getattr(strip, "channelbags", ())
    if hasattr(action, "fcurves"):
        yield action


def remove_curves(owner, is_removed):
    """Removes those curves of the owner's action of which `is_removed(curve)` holds, and the action where
    nothing is left of it."""
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
    """Gives a copy an action of its own, where it has one."""
    data = owner.animation_data
    if data is not None and data.action is not None:
        data.action = data.action.copy()


def has_keys(item, path):
    """Whether an object's own action moves properties whose path begins like that."""
    data = item.animation_data
    action = data.action if data is not None else None
    return action is not None and any(curve.data_path.startswith(path) for curve in curves_of(action))


def curves_of(action):
    """An action's curves."""
    for bag in bags_of(action):
        yield from bag.fcurves


def pace(scene):
    """How far its animation goes on from one frame of a scene to the next; 1 unless frames are remapped."""
    return scene.render.frame_map_old / scene.render.frame_map_new


def key_at(owner, path, frame, **given):
    """Inserts a keyframe of what is to be seen at a frame of the scene."""
    owner.keyframe_insert(path, frame=frame * pace(bpy.context.scene), **given)
