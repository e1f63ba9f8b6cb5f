# SPDX-License-Identifier: GPL-3.0-or-later
"""A live shape that is an object of its own: a surface, or the copy that the user wants as the result."""

import bpy

from ..blender import mesh_arrays, modifier_stack, undo_steps
from ..blender.object_references import ObjectReference, in_scene, settings_of
from ..core.errors import UserError
from ..results import result_objects, visibility

LIVE = "LIVE"  # kind of a live result in the source's list of results


class LiveObject:
    """Made when live mode starts; hides the source in viewports and renders."""

    in_place, arrays = False, ()

    def __init__(self, context, source, surface):
        undo_steps.refuse_new(source)
        mesh = result_objects.shown_mesh(context, source, len(surface.local))
        active, selected = context.view_layer.objects.active, list(context.selected_objects)
        item = result_objects.show(context, source, LIVE, LIVE, mesh, {"output": LIVE}, select=False)
        visibility.show_alone(source, item, for_now=True)
        context.view_layer.objects.active = active
        for other in selected:
            other.select_set(True)
        self.result = ObjectReference(item)

    def bind(self, context, source):
        """Gives the object the source's present vertices and faces, unless it shows an implicit surface."""
        item = self.result.get()
        if settings_of(source).output == "WARP" and item.mode != "EDIT":
            shown = modifier_stack.mesh_copy(context, source)
            try:
                if not mesh_arrays.same_topology(item.data, shown):
                    mesh_arrays.take_all(item.data, shown)
            finally:
                bpy.data.meshes.remove(shown)

    def is_there(self):
        """Whether the object is in the step that was undone to."""
        return in_scene(self.result.find())

    def require(self, source):
        """Raises UserError if the user has deleted the object."""
        self.result.get()

    def show(self, source, shape):
        """Writes a Shape to the object's mesh; False in Edit Mode, or if its topology is unknown."""
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
        """Removes the object, even if undo has unlinked it from all scenes, and shows the source again."""
        if source is not None:
            forget(source)
        leftover = self.result.find()
        if leftover is not None:
            result_objects.discard(leftover)

    def keep(self, context, source, kind):
        """Replaces the live object by a result of that kind with the same mesh; returns the result."""
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
    """Ends the source's live state, restores its visibility; returns its live result's object, or None."""
    settings_of(source).live_kind = ""
    visibility.give_back(source)
    return forget_result(source)


def forget_result(source):
    """Removes the live result from the source's list of results; returns its object, or None."""
    settings, item = settings_of(source), None
    for index in reversed(range(len(settings.results))):
        if settings.results[index].kind == LIVE:
            item = settings.results[index].item
            settings.results.remove(index)
    return item
