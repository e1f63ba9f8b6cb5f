# SPDX-License-Identifier: GPL-3.0-or-later
"""Disables Armature modifiers whose bones are handles, while the field poses instead."""

import json

from ..blender import modifier_stack
from ..blender.object_references import settings_of


def silence(source):
    """Disables them and stores their visibility; restores those that the field no longer replaces."""
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
    """Restores the visibility of all of them."""
    noted = read(source)
    for modifier in source.modifiers:
        if key_in(noted, modifier) is not None:
            modifier.show_viewport, modifier.show_render = noted[key_in(noted, modifier)]
    write(source, {})


def key_in(noted, modifier):
    """Key of a stored modifier: its persistent_uid, or in files of earlier versions its name; or None."""
    keys = str(modifier.persistent_uid), modifier.name
    return next((key for key in keys if key in noted), None)


def read(source):
    text = settings_of(source).silenced
    return json.loads(text) if text else {}


def write(source, noted):
    text = json.dumps(noted) if noted else ""
    if settings_of(source).silenced != text:  # any write tags the object as updated
        settings_of(source).silenced = text
