# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracks whether meshes or settings have changed since their fit, by depsgraph updates only."""

import json

import bpy

from ..blender.object_references import settings_of
from ..core.settings.parameters import native_options
from ..field_modifier import motion
from .surface_fit import fit_values

changed = set()  # session_uid of objects whose geometry was updated since their fit


def options_text(settings):
    """The settings of an object's fit as a comparable text."""
    return json.dumps(sorted(native_options("fit", fit_values(settings.fit, None)).items()))


def mark_fitted(source, surface):
    """Marks the source's fit as up to date."""
    changed.discard(source.session_uid)
    settings_of(source).fit_options = json.dumps(sorted(surface.fit.options.items()))


def reason(source):
    """Text to translate that says why the last fit is out of date; "" if it is not known to be."""
    if source.session_uid in changed:
        return "The mesh changed since the fit"
    settings = settings_of(source)
    return "The settings changed since the fit" if settings.fit_options != options_text(settings) else ""


def watch(depsgraph):
    """Records the objects whose geometry a depsgraph has updated."""
    for update in depsgraph.updates:
        if update.is_updated_geometry and isinstance(update.id, bpy.types.Object):
            source = update.id.original
            if settings_of(source).fit_key and source.session_uid not in motion.written:
                changed.add(source.session_uid)
