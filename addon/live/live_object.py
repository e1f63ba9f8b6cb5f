# SPDX-License-Identifier: GPL-3.0-or-later
"""A live shape that is an object of its own: a surface, or the copy that the user wants as the result."""

import bpy

from ..blender import mesh_arrays
from ..blender.object_references import ObjectReference, settings_of
from ..core.errors import UserError
from ..results import result_objects, visibility

LIVE = "LIVE"  # kind of the result that a live source has


class LiveObject:
    """Made at the start; the source is out of sight and out of renders meanwhile."""

    in_place, arrays = False, ()

    def __init__(self, context, source, surface):
        mesh = result_objects.shown_mesh(context, source, len(surface.local))
        active, selected = context.view_layer.objects.active, list(context.selected_objects)
        item = result_objects.show(context, source, LIVE, LIVE, mesh, {"output": LIVE}, select=False)
        visibility.show_alone(source, item, for_now=True)
        context.view_layer.objects.active = active
        for other in selected:
            other.select_set(True)
        self.result = ObjectReference(item)

    def require(self, source):
        """UserError where the user has deleted it."""
        self.result.get()

    def show(self, source, shape):
        """Puts a session's shape on the object; whether it could."""
        item = self.result.get()
        if item.mode == "EDIT":
            return False
        if len(item.data.vertices) != len(shape.points):
            if shape.topology is None:
                return False
            mesh_arrays.fill(item.data, shape.points, shape.topology)
        mesh_arrays.set_positions(item.data, shape.points)
        return True

    def take_away(self, source):
        """Removes it, also where an undone step left it in no scene; the source, if any, is seen again."""
        if source is not None:
            forget(source)
        leftover = self.result.find()
        if leftover is not None:
            result_objects.discard(leftover)

    def keep(self, context, source, kind):
        """Turns it into an ordinary result of that kind; returns that."""
        item = self.result.find()
        if item is None:
            raise UserError("{name} has no live result", source)
        forget(source)
        mesh = item.data
        bpy.data.objects.remove(item)
        item = result_objects.show(context, source, kind, settings_of(source).output, mesh, {"output": LIVE})
        visibility.show_alone(source, item)
        return item


def forget(source):
    """The source is no longer live: it is seen as before, and lists no live result; returns that, if any."""
    settings_of(source).live_kind = ""
    visibility.give_back(source)
    return forget_result(source)


def forget_result(source):
    """Takes the live result off the source's list; returns it, if any."""
    settings, item = settings_of(source), None
    for index in reversed(range(len(settings.results))):
        if settings.results[index].kind == LIVE:
            item = settings.results[index].item
            settings.results.remove(index)
    return item
