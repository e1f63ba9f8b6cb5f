# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.guide import Guided
from ..blender.language import translated
from ..core.runtime import jobs
from ..names import Op


class ARAPFIELDS_OT_cancel(Guided, bpy.types.Operator):
    """Stop the running job; nothing of it is kept"""

    bl_idname = Op.CANCEL
    bl_label = "Cancel"
    guide = "jobs"

    @classmethod
    def poll(cls, context):
        if jobs.running() is None:
            cls.poll_message_set(translated("No job is running"))
        return jobs.running() is not None

    def execute(self, context):
        jobs.running().cancel()
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_cancel]
