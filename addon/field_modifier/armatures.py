# SPDX-License-Identifier: GPL-3.0-or-later
"""Armature modifiers whose bones are handles: the field poses in their place, so they are off meanwhile."""

import json

from ..blender import modifier_stack
from ..blender.object_references import settings_of


def silence(source):
    """Switches them off, and notes how they were; those that the field replaces no more are on again."""
    rigs = modifier_stack.handle_rigs(source)
    noted = read(source)
    for modifier in source.modifiers:
        if modifier_stack.is_replaced(modifier, rigs):
            if key_in(noted, modifier) is None:
                noted[str(modifier.persistent_uid)] = [modifier.show_viewport, modifier.show_render]
            modifier.show_viewport = modifier.show_render = False
        elif key_in(noted, modifier) is not None:
            modifier.show_viewport, modifier.show_render = noted.pop(key_in(noted, modifier))
    write(source, noted)


def restore(source):
    """Has all of them as they were."""
    noted = read(source)
    for modifier in source.modifiers:
        if key_in(noted, modifier) is not None:
            modifier.show_viewport, modifier.show_render = noted[key_in(noted, modifier)]
    write(source, {})


def key_in(noted, modifier):
    """By what a modifier is noted: its number, or its name in files of earlier versions; or None."""
    keys = str(modifier.persistent_uid), modifier.name
    return next((key for key in keys if key in noted), None)


def read(source):
    text = settings_of(source).silenced
    return json.loads(text) if text else {}


def write(source, noted):
    text = json.dumps(noted) if noted else ""
    if settings_of(source).silenced != text:  # a write counts as a change of the object
        settings_of(source).silenced = text
