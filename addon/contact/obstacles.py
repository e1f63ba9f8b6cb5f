# SPDX-License-Identifier: GPL-3.0-or-later
"""Adds entries to a source's list of obstacles."""

from ..blender.object_references import settings_of


def add(source, item, margin=0.0):
    """Adds an object, or with None an empty row, to a source's list; returns the entry."""
    group = settings_of(source).contact
    entry = group.obstacle_list.add()
    group.active_obstacle = len(group.obstacle_list) - 1
    entry.margin = margin
    if item is not None:
        entry.name, entry.item = item.name, item
    return entry
