# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects across ticks of a job: found again by their session's number, never kept as references."""

import bpy

from ..core.errors import UserError
from ..names import PROPERTY


class ObjectReference:
    """Stands for an object while a job runs; the object may be renamed, undone or deleted meanwhile."""

    def __init__(self, item):
        self.name, self.uid = item.name, item.session_uid

    def get(self):
        for item in bpy.data.objects:
            if item.session_uid == self.uid:
                return item
        raise UserError("{name} was deleted while it was worked on", name=self.name)


def settings_of(item):
    return getattr(item, PROPERTY)


def source_of(context):
    """The mesh object that the panel and the operators work on, or None.

    The active object when it is a mesh; the owner of the active handle or result.
    """
    active = context.view_layer.objects.active if context.view_layer else None
    if active is None:
        return None
    settings = settings_of(active)
    if active.type == "EMPTY":
        if settings.handle_of is not None:
            return settings.handle_of
        meshes = [item for item in context.selected_objects if item.type == "MESH"]
        return meshes[0] if len(meshes) == 1 else None
    if active.type != "MESH":
        return None
    return settings.result_of if settings.result_of is not None else active


def refusal(item, in_edit_mode=False):
    """Why an object cannot be worked on, as a UserError; None where it can."""
    if item is None:
        return UserError("Select a mesh object")
    if item.type != "MESH":
        return UserError("{name} is not a mesh object", name=item.name)
    if item.mode == "EDIT" and not in_edit_mode:
        return UserError("{name} is in Edit Mode; leave it first", name=item.name)
    return None
