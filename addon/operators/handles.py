# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..bridge import handles, lookup
from ..core.errors import UserError
from ..names import Op
from ..properties.handle import KINDS


class HandleOperator:
    """Mixin: works on the handles of the panel's source."""

    bl_options = {"REGISTER", "UNDO"}
    needs_handle = True

    @classmethod
    def poll(cls, context):
        source = lookup.source_of(context)
        reason = lookup.refusal(source)
        if not reason and cls.needs_handle and not lookup.settings_of(source).handles:
            reason = "The object has no handle"
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context):
        context.view_layer.update()
        try:
            self.report({"INFO"}, self.change(context, lookup.source_of(context)))
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


def chosen_entries(context, source):
    """The handles whose Empties are selected, or the one chosen in the list."""
    ours = lookup.settings_of(source)
    selected = [entry for entry in handles.used(source) if entry.empty in context.selected_objects]
    if selected:
        return selected
    index = ours.active_handle
    return [ours.handles[index]] if 0 <= index < len(ours.handles) else []


class ARAPFIELDS_OT_add_handle(HandleOperator, bpy.types.Operator):
    """Make the selected Empties handles of the object, or make one at the 3D cursor"""

    bl_idname = Op.ADD_HANDLE
    bl_label = "Add Handle"
    needs_handle = False

    kind: bpy.props.EnumProperty(items=KINDS, name="Kind", description="What of the surface the handle holds")
    group: bpy.props.StringProperty(
        name="Vertex Group", description="The group to hold, for that kind; empty for the object's active one"
    )

    def change(self, context, source):
        group = self.group or (source.vertex_groups.active.name if source.vertex_groups else "")
        if self.kind == "GROUP" and not group:
            raise UserError(f"{source.name} has no vertex group")
        empties = [item for item in context.selected_objects if item.type == "EMPTY"]
        empties = empties or [handles.new_empty(context, source, self.kind, group)]
        for empty in empties:
            entry = handles.add(source, empty, self.kind)
            entry.group = group if self.kind == "GROUP" else ""
        handles.count_inside(context, source)
        return f"{len(empties)} handle{'s' if len(empties) > 1 else ''} of {source.name}"


class ARAPFIELDS_OT_set_rest(HandleOperator, bpy.types.Operator):
    """Make where the selected handles are now their rest pose (all handles with `all`)"""

    bl_idname = Op.SET_REST
    bl_label = "Set Rest Pose"

    all: bpy.props.BoolProperty(name="All", description="Every handle of the object, selected or not")

    def change(self, context, source):
        entries = handles.used(source) if self.all else chosen_entries(context, source)
        for entry in entries:
            if entry.empty is not None:
                handles.store_rest(source, entry)
        handles.count_inside(context, source)
        return f"rest pose of {len(entries)} handles stored"


class ARAPFIELDS_OT_reset_handle(HandleOperator, bpy.types.Operator):
    """Move the selected handles back to their rest pose (all handles with `all`)"""

    bl_idname = Op.RESET_HANDLE
    bl_label = "Reset to Rest"

    all: bpy.props.BoolProperty(name="All", description="Every handle of the object, selected or not")

    def change(self, context, source):
        entries = handles.used(source) if self.all else chosen_entries(context, source)
        for entry in entries:
            if entry.empty is not None:
                handles.reset(source, entry)
        return f"{len(entries)} handles moved back"


class ARAPFIELDS_OT_remove_handle(HandleOperator, bpy.types.Operator):
    """Take the selected handles off the list (or the one chosen in it); with `delete`, their Empties too"""

    bl_idname = Op.REMOVE_HANDLE
    bl_label = "Remove Handle"

    delete: bpy.props.BoolProperty(name="Delete Empties", description="Delete the Empties as well")

    def change(self, context, source):
        ours = lookup.settings_of(source)
        rows = [index for index, entry in enumerate(ours.handles) if entry in chosen_entries(context, source)]
        for index in reversed(rows):
            empty = ours.handles[index].empty
            handles.remove(source, index)
            if self.delete and empty is not None:
                bpy.data.objects.remove(empty)
        return f"{len(rows)} handles removed"


CLASSES = [
    ARAPFIELDS_OT_add_handle,
    ARAPFIELDS_OT_set_rest,
    ARAPFIELDS_OT_reset_handle,
    ARAPFIELDS_OT_remove_handle,
]
