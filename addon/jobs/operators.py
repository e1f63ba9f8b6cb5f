# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.source_operator import Guided
from ..core.errors import UserError
from ..core.runtime import jobs


class ARAPFIELDS_OT_cancel(Guided, bpy.types.Operator):
    """Stop the running job; nothing of it is kept"""

    bl_label = "Cancel"
    guide = "jobs"

    @classmethod
    def obstacle(cls, context):
        return UserError("No job is running") if jobs.running() is None else None

    def execute(self, context):
        jobs.running().cancel()
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_cancel]
