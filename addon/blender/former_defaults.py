# SPDX-License-Identifier: GPL-3.0-or-later
"""Defaults and meanings that have changed: objects of older files keep the former, and so their shapes."""

import math

import bpy

from .evaluation import curves_of
from .object_references import settings_of

# Settings by group, with the values that were the defaults of version 0, 1, …
FORMER = [{("deform", "locality"): 0.0}, {}]
NEWEST = len(FORMER)
EVEN = 2  # the version from which on half of a style's strength moves a surface by half of the way
# Before, the strength was the share of the style's weight. How far a surface moves grows with its logarithm.
GROWTH = 80.0


def begin(settings):
    """The settings of an object that gets its first handle have the newest defaults, and no former rule."""
    if settings.keep_rest or settings.hold_far:
        settings.keep_rest = settings.hold_far = False
        settings.deform.property_unset("locality")
    settings.defaults = NEWEST


def keep():
    """Gives settings of older files that were never set the values that they had there, and those that were
    set and mean something else now the values that mean the same."""
    even = set()  # actions whose keys have been converted: objects may share them
    for source in list(bpy.data.objects):
        settings = settings_of(source)
        styled = settings.stylize.is_property_set("strength")
        if not (settings.handles or styled) or settings.defaults >= NEWEST:
            continue
        if settings.handles:
            for former in FORMER[settings.defaults :]:
                for (group, name), value in former.items():
                    own = getattr(settings, group)
                    if not own.is_property_set(name):
                        setattr(own, name, value)
        if styled and settings.defaults < EVEN:
            settings.stylize.strength = even_strength(settings.stylize.strength)
            make_keys_even(source, even)
        settings.defaults = NEWEST


def make_keys_even(source, done):
    """Converts the keyframes of a strength in the source's action, unless it is `done`, a set of actions."""
    action = source.animation_data.action if source.animation_data is not None else None
    if action is None or action.library is not None or action in done:
        return
    done.add(action)
    for curve in {curve.as_pointer(): curve for curve in curves_of(action)}.values():
        if curve.data_path != "arapfields.stylize.strength":
            continue
        for key in curve.keyframe_points:
            for point in (key.handle_left, key.handle_right, key.co):
                point[1] = even_strength(point[1])
        curve.update()


def even_strength(share):
    """The strength that goes about as far as a style of this share of its whole weight."""
    return math.log1p((GROWTH - 1) * share) / math.log(GROWTH) if 0 <= share < 1 else share


def stamp():
    """Before a file is saved: objects with a style's strength have the newest meaning of it."""
    for source in list(bpy.data.objects):
        settings = settings_of(source)
        if source.library is None and settings.stylize.is_property_set("strength") and not settings.handles:
            settings.defaults = NEWEST
