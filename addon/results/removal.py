# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes the last result off its source."""

from ..blender import modifier_stack
from ..blender.object_references import settings_of
from ..carried import carrying, rest_bones
from ..core.errors import UserError
from ..field_modifier import layers, motion
from ..field_nodes import helper
from ..handles.following import Followers
from . import visibility


def take_off(context, source):
    """Removes the modifier of the last result with its motion; the result below it is the last one then.
    Returns an error of bones that cannot be put back, or None."""
    reason = None
    layers.uncover(source, baked=True)
    followers = Followers(context, source) if settings_of(source).moved_by == "WRAP" else None
    try:
        if not modifier_stack.layers(source):
            rest_bones.reset(context, source)
    except UserError as error:
        reason = error
    motion.remove(source)
    layers.uncover(source)
    carrying.give_back_all(source)
    helper.clear(source)
    if followers is not None:
        followers.follow(context, source, back=True)
        visibility.show_landmarks(source, True)
    return reason
