# SPDX-License-Identifier: GPL-3.0-or-later
"""The top of the panel, without a title: the object, the tasks, and the pin tool; and the section that holds
those about other objects."""

import bpy

from ..blender.language import translated
from ..blender.point_data import face_count, points_of
from ..blender.section import TASKS, Section, tasks_of
from ..blender.splat_layouts import holds_splats
from ..names import TOOL, Op

ROWS = (TASKS[:3], TASKS[3:])  # in one row their names would be cut off


def is_tool_taken(context):
    """Whether the pin tool is the one in use in this workspace's Object Mode."""
    tools = getattr(context.workspace, "tools", None)
    tool = tools.from_space_view3d_mode("OBJECT", create=False) if tools is not None else None
    return tool is not None and tool.idname == TOOL


class ARAPFIELDS_PT_tasks(Section, bpy.types.Panel):
    bl_label = "Tasks"
    bl_order = 1
    bl_options = {"HIDE_HEADER"}
    needs_source = False

    @classmethod
    def poll(cls, context):
        return super().poll(context) and bool(tasks_of(context))

    def fill(self, context, source, settings):
        layout = self.layout
        if source is not None:
            text = f"{source.name}: {counts_of(source)}"
            layout.label(text=text, icon="MESH_DATA", translate=False)  # one line, or the tasks would move
        if len(tasks_of(context)) > 1:
            layout.use_property_split = False
            rows = layout.column(align=True)
            for tasks in ROWS:
                row = rows.row(align=True)
                for task in tasks:
                    row.prop_enum(context.scene.arapfields, "task", task)
            row = layout.row()
            row.scale_y = 1.6
            row.operator(Op.PIN_TOOL, text="Pin", icon="PINNED", depress=is_tool_taken(context))


def counts_of(source):
    """How many points an object has."""
    counts = {"vertices": f"{len(points_of(source.data)):,}", "faces": f"{face_count(source.data):,}"}
    if holds_splats(source):
        return translated("{count} splats", count=counts["vertices"])
    return translated("{vertices} vertices, {faces} faces", **counts)


class ARAPFIELDS_PT_others(Section, bpy.types.Panel):
    """What moves along, and what is in the way."""

    bl_label = "Other Objects"
    bl_order = 6
    tasks = frozenset({"POSE", "STYLE", "WRAP"})
    bl_options = {"DEFAULT_CLOSED"}

    def fill(self, context, source, settings):
        pass


CLASSES = [ARAPFIELDS_PT_tasks, ARAPFIELDS_PT_others]
