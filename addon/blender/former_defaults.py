# SPDX-License-Identifier: GPL-3.0-or-later
"""Defaults that have changed: objects of older files keep the former ones, and so their shapes."""

import bpy

from .object_references import settings_of

# Settings by group, with the values that were the defaults of version 0, 1, …
FORMER = [{("deform", "locality"): 0.0}]
NEWEST = len(FORMER)


def begin(settings):
    """The settings of an object that gets its first handle have the newest defaults."""
    settings.defaults = NEWEST


def keep():
    """Gives settings of older files that were never set the values that they had there."""
    for source in list(bpy.data.objects):
        settings = settings_of(source)
        if not settings.handles or settings.defaults >= NEWEST:
            continue
        for former in FORMER[settings.defaults :]:
            for (group, name), value in former.items():
                own = getattr(settings, group)
                if not own.is_property_set(name):
                    setattr(own, name, value)
        settings.defaults = NEWEST
