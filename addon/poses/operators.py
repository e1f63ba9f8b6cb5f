# SPDX-License-Identifier: GPL-3.0-or-later
"""Stored poses: the scene's list, its operators, the panel."""

from pathlib import Path

import bpy

from ..blender.language import translated
from ..blender.property_definitions import number, path_text, text
from ..blender.section import Section
from ..blender.source_operator import ReportingOperator, SourceOperator
from ..core import poses
from ..core.errors import UserError
from ..core.runtime import native
from ..names import Op
from . import applying

SUFFIX = ".arappose"


def kept_poses(context):
    return context.scene.arapfields.poses


def chosen(context, name):
    """The stored pose of that name, or the active one of the list; UserError without one."""
    kept = kept_poses(context)
    index = kept.find(name) if name else context.scene.arapfields.active_pose
    if not 0 <= index < len(kept):
        raise UserError("There is no pose {name}", name=name) if name else UserError("Save a pose first")
    return kept[index]


def keep(context, name, content):
    """Adds a pose to the scene's list, or replaces the one of the same name."""
    group = context.scene.arapfields
    entry = group.poses.get(name) or group.poses.add()
    entry.name, entry.data = name, poses.to_text(content)
    group.active_pose = group.poses.find(name)


def read(path):
    try:
        return Path(bpy.path.abspath(path)).read_bytes()
    except OSError as error:
        raise UserError("{path}: {error}", path=path, error=error.strerror) from error


class PoseOperator(ReportingOperator):
    """Mixin of all pose operators."""

    bl_options = {"REGISTER", "UNDO"}
    guide = "characters"


class OfSource(PoseOperator, SourceOperator):
    """Mixin of pose operators that need a source."""


class ARAPFIELDS_OT_save_pose(OfSource, bpy.types.Operator):
    """Keep the field that deforms the object, with the file, to apply it to other meshes of this shape"""

    bl_label = "Save Pose"
    of_linked = True

    pose: text("Name", "Name of the pose", default="Pose")

    def change(self, context, source):
        keep(context, self.pose, poses.to_bytes(applying.solved_pose(context, source)))
        return translated("{name} kept", name=self.pose)

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)


class ARAPFIELDS_OT_apply_pose(OfSource, bpy.types.Operator):
    """Put the object where a kept pose's field takes it; other meshes of the same shape do as well"""

    bl_label = "Apply Pose"

    pose: text("Name", "Name of the pose; empty for the chosen one")
    filepath: path_text("File", "A pose's file, in place of a kept pose", "FILE")
    strength: number("Strength", "How far of the way the points go", default=1.0, soft_min=0.0, soft_max=1.0)

    def change(self, context, source):
        if self.filepath:
            name = Path(self.filepath).name
            content = read(self.filepath)
        else:
            entry = chosen(context, self.pose)
            name, content = entry.name, poses.from_text(entry.data, entry.name)
        for reason in applying.apply(context, source, poses.from_bytes(content, name), self.strength):
            self.report({"WARNING"}, translated(reason))
        return translated("{pose} applied to {name}", pose=name, name=source.name)


class OfPose(PoseOperator):
    """Mixin of pose operators that need a stored pose."""

    @classmethod
    def obstacle(cls, context):
        return None if kept_poses(context) else UserError("Save a pose first")


class ARAPFIELDS_OT_remove_pose(OfPose, bpy.types.Operator):
    """Take the chosen pose off the list; what it was applied to stays"""

    bl_label = "Remove Pose"

    pose: text("Name", "Name of the pose; empty for the chosen one")

    def change(self, context, source):
        group, name = context.scene.arapfields, chosen(context, self.pose).name
        group.poses.remove(group.poses.find(name))
        group.active_pose = max(0, min(group.active_pose, len(group.poses) - 1))
        return translated("{name} removed", name=name)


class PoseFile:
    """Mixin: a file is chosen in a window."""

    filepath: path_text("File", "The pose's file", "FILE")
    filter_glob: text("Filter", "Files that are shown", default=f"*{SUFFIX}", options={"HIDDEN"})

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class ARAPFIELDS_OT_export_pose(PoseFile, OfPose, bpy.types.Operator):
    """Write the chosen pose to a file, for other files and scripts"""

    bl_label = "Export Pose"

    def change(self, context, source):
        entry = chosen(context, "")
        native.library()
        from arapfields._files import whole_file

        path = Path(bpy.path.abspath(self.filepath))
        if path.suffix.lower() != SUFFIX:
            path = path.with_name(path.name + SUFFIX)  # of a.1 and a.2 as well
        with whole_file(path) as partial:
            partial.write_bytes(poses.from_text(entry.data, entry.name))
        return translated("{name} kept", name=path.name)


class ARAPFIELDS_OT_import_pose(PoseFile, PoseOperator, bpy.types.Operator):
    """Add a pose from a file to the list"""

    bl_label = "Import Pose"

    def change(self, context, source):
        content, name = read(self.filepath), Path(self.filepath).stem
        poses.from_bytes(content, Path(self.filepath).name)
        keep(context, name, content)
        return translated("{name} kept", name=name)


class ARAPFIELDS_UL_poses(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index):
        layout.prop(item, "name", text="", emboss=False, icon="ARMATURE_DATA")


class ARAPFIELDS_PT_poses(Section, bpy.types.Panel):
    bl_label = "Poses"
    bl_order = 8
    tasks = frozenset({"RIG"})
    bl_options = {"DEFAULT_CLOSED"}

    def fill(self, context, source, settings):
        group, layout = context.scene.arapfields, self.layout
        row = layout.row()
        row.template_list("ARAPFIELDS_UL_poses", "", group, "poses", group, "active_pose", rows=3)
        column = row.column(align=True)
        column.operator(Op.SAVE_POSE, icon="ADD", text="")
        column.operator(Op.REMOVE_POSE, icon="REMOVE", text="")
        column.separator()
        column.operator(Op.IMPORT_POSE, icon="IMPORT", text="")
        column.operator(Op.EXPORT_POSE, icon="EXPORT", text="")
        layout.operator(Op.APPLY_POSE, icon="CHECKMARK")


CLASSES = [
    ARAPFIELDS_OT_save_pose,
    ARAPFIELDS_OT_apply_pose,
    ARAPFIELDS_OT_remove_pose,
    ARAPFIELDS_OT_export_pose,
    ARAPFIELDS_OT_import_pose,
    ARAPFIELDS_UL_poses,
    ARAPFIELDS_PT_poses,
]
