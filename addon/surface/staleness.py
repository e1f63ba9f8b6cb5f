# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose mesh or settings changed since its fit: seen from Blender's updates, without reading any mesh."""

import contextlib
import json

import bpy

from ..blender.object_references import settings_of
from ..core.settings.parameters import native_options
from .source_surface import fit_values

_changed = set()  # session numbers of objects whose geometry was updated since their fit


def options_text(ours):
    """The fit's settings of an object, comparable."""
    return json.dumps(sorted(native_options(fit_values(ours.fit, None)).items()))


def fitted(source, surface):
    """Notes that this source has just been fitted."""
    _changed.discard(source.session_uid)
    settings_of(source).fit_options = json.dumps(sorted(surface.fit_options.items()))


def reason(source):
    """Why the last fit is out of date, as a text to translate; empty where it is not known to be."""
    if source.session_uid in _changed:
        return "The mesh changed since the fit"
    ours = settings_of(source)
    return "The settings changed since the fit" if ours.fit_options != options_text(ours) else ""


@bpy.app.handlers.persistent
def watch(scene, depsgraph):
    for update in depsgraph.updates:
        if update.is_updated_geometry and isinstance(update.id, bpy.types.Object):
            source = update.id.original
            if settings_of(source).fit_key:
                _changed.add(source.session_uid)


@bpy.app.handlers.persistent
def forget(*_):
    _changed.clear()


def register():
    bpy.app.handlers.depsgraph_update_post.append(watch)
    bpy.app.handlers.load_pre.append(forget)


def unregister():
    for handlers, function in (
        (bpy.app.handlers.depsgraph_update_post, watch),
        (bpy.app.handlers.load_pre, forget),
    ):
        with contextlib.suppress(ValueError):
            handlers.remove(function)
