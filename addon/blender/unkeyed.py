# SPDX-License-Identifier: GPL-3.0-or-later
"""Preserves unkeyed values while a temporary scene is evaluated at another frame.

Blender copies the last evaluated values, of any scene, back to the original data-blocks: poses without
keyframes would be lost.
"""

import contextlib

from .actions import curves_of
from .evaluation import updated
from .references import put_at


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
