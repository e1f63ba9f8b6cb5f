# SPDX-License-Identifier: GPL-3.0-or-later
"""The object that follows while its source is live: made, taken away again, or kept."""

import bpy

from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..results import result_objects

LIVE = "LIVE"  # kind of the result that a live source has


def show(context, source, mesh):
    """The live result with this mesh; the source is shown as a mere box meanwhile."""
    active, selected = context.view_layer.objects.active, list(context.selected_objects)
    item = result_objects.show(context, source, LIVE, LIVE, mesh, {"output": LIVE}, select=False)
    settings = settings_of(source)
    if not settings.live_display:
        settings.live_display = source.display_type
        source.display_type = "BOUNDS"
    context.view_layer.objects.active = active
    for other in selected:
        other.select_set(True)
    return item


def of(source):
    """The live result of a source, or None."""
    entries = settings_of(source).results
    return next((entry.item for entry in entries if entry.kind == LIVE and entry.item is not None), None)


def drop(source):
    """Takes the live result away; the source is displayed as before."""
    item = of(source)
    restore(source)
    if item is not None:
        result_objects.discard(item)


def restore(source):
    settings = settings_of(source)
    if settings.live_display:
        source.display_type = settings.live_display
        settings.live_display = ""
    for index in reversed(range(len(settings.results))):
        if settings.results[index].kind == LIVE:
            settings.results.remove(index)


def keep(context, source, kind):
    """Turns the live result into an ordinary one of that kind; returns it."""
    item = of(source)
    if item is None:
        raise UserError("{name} has no live result", name=source.name)
    restore(source)
    mesh = item.data
    bpy.data.objects.remove(item)
    return result_objects.show(context, source, kind, settings_of(source).output, mesh, {"output": LIVE})
