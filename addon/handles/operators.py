# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import vertex_groups
from ..blender.language import translated
from ..blender.object_references import refusal_of_linked, select_alone, settings_of, source_of
from ..blender.property_definitions import choice, flag, text
from ..blender.references import takes_references
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError, refuse
from ..core.geometry.handles import nothing_held
from ..core.geometry.spaces import space_of
from ..core.runtime import native
from ..core.settings.choices import BONES, EMPTY_KINDS, HANDLE_PLACES
from ..field_modifier import layers
from . import bones, empties, held_counts, keyframes, movers


class HandleOperator(SourceOperator):
    """Mixin: works on the handles of the panel's source."""

    bl_options = {"REGISTER", "UNDO"}
    guide = "handles"
    needs_handle = True
    counts_points = False  # whether it counts the points that handles hold

    @classmethod
    def obstacle(cls, context):
        return native.problem() or super().obstacle(context)

    @classmethod
    def refuses(cls, source):
        without = cls.needs_handle and not empties.listed(source)
        return UserError("The object has no handle") if without else None

    def warn(self, context):
        """Reports handles that hold nothing, which a solve would refuse."""
        names = empties.holding_nothing(source_of(context)) if self.counts_points else ()
        if names:
            self.report({"WARNING"}, translated(nothing_held(names)))


def chosen_entries(context, source):
    """The handles whose Empties are selected, or the active one of the list."""
    selected = [entry for entry in empties.used(source) if is_selected(context, entry)]
    if selected:
        return selected
    copies = [item for item in context.selected_objects if settings_of(item).handle_of == source]
    if copies:
        raise UserError(
            "{name} is a copy of a handle and is none itself; add it as a handle first", copies[0]
        )
    return list(filter(None, [empties.chosen_entry(source)]))


def is_selected(context, entry):
    if entry.kind == "BONE":
        return entry.rig.mode == "POSE" and bones.is_selected(entry.rig, movers.bone_of(entry))
    return entry.empty in context.selected_objects


class ARAPFIELDS_OT_add_handle(HandleOperator, bpy.types.Operator):
    """Make the selected Empties handles of the object, or make a new box at the cursor or around vertices"""

    bl_label = "Add Handle"
    needs_handle = False
    in_edit_mode = counts_points = True

    kind: choice(EMPTY_KINDS, "Kind", "What of the surface the handle holds")
    place: choice(HANDLE_PLACES, "Place", "Where the handle is", options={"SKIP_SAVE"})
    group: text("Vertex Group", "The group to hold, for that kind; empty for the object's active one")

    def change(self, context, source):
        group = self.group or vertex_groups.active_name(source)
        if self.kind == "GROUP" and not group:
            raise vertex_groups.none_chosen(source)
        selected = [item for item in context.selected_objects if item.type == "EMPTY"]
        is_new = not selected or self.place != "AUTO" or source.mode == "EDIT"
        space_of(movers.matrix_of(source), source.name)
        for empty in () if is_new else selected:
            empties.require_fit(source, empty)
        with layers.way_for_handle(context, source):
            if is_new:
                selected = [empties.new_empty(context, source, self.kind, group, self.place)]
        others = {settings_of(empty).handle_of for empty in selected} - {None, source}
        for empty in selected:
            if empties.is_blenders_own(empty) and takes_references(empty):
                empty.name = empties.name_for(source, empty.matrix_world.translation, self.kind)
            entry = empties.add(source, empty, self.kind)
            entry.group = group if self.kind == "GROUP" else ""
        if is_new:
            select_alone(context, selected[0])  # to be moved at once
        held_counts.count_for(self, context, source)
        for other in sorted(item.name for item in others):
            text = translated("Handles of {other} were taken over by {name}", other=other, name=source.name)
            self.report({"WARNING"}, text)
        return translated("Handles added to {name}: {count}", count=len(selected), name=source.name)


class ARAPFIELDS_OT_add_bones(HandleOperator, bpy.types.Operator):
    """Make handles of an armature's bones: posing it moves what they hold"""

    bl_label = "From Armature"
    needs_handle = False
    counts_points = True

    bones: choice(BONES, "Bones", "Which bones become handles")

    def change(self, context, source):
        rig = bones.armature_of(context, source)
        with layers.way_for_handle(context, source):
            groups = bones.holding_groups(context, source)
            names = bones.chosen(rig, self.bones, groups)
        for name in names:
            bones.add(source, rig, name, groups)
        is_asked = self.bones == "SELECTED"
        held_counts.count_for(self, context, source, at_once=not is_asked)
        if not is_asked:
            names = bones.keep_holding(source, rig, names)
            error = bones.unposed(context, source)
            if error is not None:
                self.report({"WARNING"}, translated(error))
        return translated("Handles added to {name}: {count}", count=len(names), name=source.name)


class ARAPFIELDS_OT_mirror_handle(HandleOperator, bpy.types.Operator):
    """Make handles like the selected ones on the other side of the object"""

    bl_label = "Mirror Handle"
    counts_points = True

    axis: choice(
        [(axis, axis, f"Across the object's {axis} axis") for axis in "XYZ"],
        "Axis",
        "Axis of the object across which to mirror",
    )

    def change(self, context, source):
        entries = [e for e in chosen_entries(context, source) if movers.has_mover(e)]
        keys = [movers.key_of(entry) for entry in entries]
        for key in keys:  # adding entries invalidates references
            entry = next(entry for entry in empties.used(source) if movers.key_of(entry) == key)
            if entry.kind == "BONE":
                bones.mirror(context, source, entry)
            else:
                empties.mirror(context, source, entry, "XYZ".index(self.axis))
        held_counts.count_for(self, context, source)
        return translated("Handles mirrored: {count}", count=len(entries))


class RestOperator(HandleOperator):
    """Mixin: works on the selected handles, or on all."""

    all: flag("All", "Every handle of the object, selected or not")

    def entries(self, context, source):
        used = empties.used(source)
        return used if self.all else [e for e in chosen_entries(context, source) if e in used]


class ARAPFIELDS_OT_set_rest(RestOperator, bpy.types.Operator):
    """Take where the selected handles are now as their rest pose: there they move nothing any more"""

    bl_label = "Set Rest Pose"
    counts_points = True

    def change(self, context, source):
        entries = self.entries(context, source)
        for entry in entries:
            empties.store_rest(source, entry)
        held_counts.count_for(self, context, source)
        return translated("Rest poses stored: {count}", count=len(entries))


class ARAPFIELDS_OT_reset_handle(RestOperator, bpy.types.Operator):
    """Move the selected handles back to where they were at rest, and the shape with them"""

    bl_label = "Move Back to Rest"

    def change(self, context, source):
        entries = self.entries(context, source)
        for entry in entries:
            if entry.kind != "BONE":
                empties.reset(source, entry)
        bones.reset(context, source, [e for e in entries if e.kind == "BONE"])
        return translated("Handles moved back: {count}", count=len(entries))


class ARAPFIELDS_OT_key_handle(HandleOperator, bpy.types.Operator):
    """Insert keyframes for the location and rotation of all handles but the anchors, on the current frame"""

    bl_label = "Insert Keyframe of Handles"
    guide = "animation"

    def change(self, context, source):
        used = empties.used(source)
        entries = [entry for entry in used if not entry.anchor] or used
        for entry in entries:
            refuse(refusal_of_linked(movers.mover_of(entry)))
        for entry in entries:
            keyframes.insert(entry)
        return translated("Handles with a keyframe: {count}", count=len(entries))


class ARAPFIELDS_OT_remove_handle(HandleOperator, bpy.types.Operator):
    """Take the selected handles off the list, or the one that is chosen in it"""

    bl_label = "Remove Handle"

    delete: flag("Delete Empties", "Delete the Empties as well")

    def change(self, context, source):
        settings = settings_of(source)
        chosen = chosen_entries(context, source)
        rows = [index for index, entry in enumerate(settings.handles) if entry in chosen]
        for index in reversed(rows):
            empty = settings.handles[index].empty
            is_own = empty is not None and settings_of(empty).handle_of == source
            empties.remove(source, index)
            if self.delete and is_own:
                empties.delete(empty)
        return translated("Handles removed: {count}", count=len(rows))


CLASSES = [
    ARAPFIELDS_OT_add_handle,
    ARAPFIELDS_OT_add_bones,
    ARAPFIELDS_OT_mirror_handle,
    ARAPFIELDS_OT_set_rest,
    ARAPFIELDS_OT_reset_handle,
    ARAPFIELDS_OT_key_handle,
    ARAPFIELDS_OT_remove_handle,
]
