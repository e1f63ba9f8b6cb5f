# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..bridge.jobs import busy
from ..bridge.language import translated
from ..bridge.settings import fit_cache
from ..core import jobs, native
from ..names import Op


class ARAPFIELDS_OT_cancel(bpy.types.Operator):
    """Stop the running job; nothing of it is kept"""

    bl_idname = Op.CANCEL
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context):
        if jobs.running() is None:
            cls.poll_message_set(translated("No job is running"))
        return jobs.running() is not None

    def execute(self, context):
        jobs.running().cancel()
        return {"FINISHED"}


class ARAPFIELDS_OT_clear_cache(bpy.types.Operator):
    """Delete every fitted surface from disk; they are fitted again when needed"""

    bl_idname = Op.CLEAR_CACHE
    bl_label = "Clear Fits"

    @classmethod
    def poll(cls, context):
        if busy():
            cls.poll_message_set(translated(busy()))
        return not busy()

    def execute(self, context):
        self.report({"INFO"}, translated("{count} fitted surfaces deleted", count=fit_cache().clear()))
        return {"FINISHED"}


class ARAPFIELDS_OT_copy_report(bpy.types.Operator):
    """Copy what is known about the native library and this machine, for a bug report"""

    bl_idname = Op.COPY_REPORT
    bl_label = "Copy Report"

    def execute(self, context):
        lines = [f"Blender {bpy.app.version_string}", *native.report()]
        context.window_manager.clipboard = "\n".join(lines)
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_cancel, ARAPFIELDS_OT_clear_cache, ARAPFIELDS_OT_copy_report]
