# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.host import has_window
from ..blender.language import translated
from ..blender.source_operator import Guided
from ..core.errors import UserError
from ..core.runtime import jobs

ASKS_AFTER = 30.0  # seconds of work that a click or a key does not throw away at once


class ARAPFIELDS_OT_cancel(Guided, bpy.types.Operator):
    """Stop the running job; nothing of it is kept, so one that has run for long asks first"""

    bl_label = "Cancel"
    guide = "jobs"

    @classmethod
    def obstacle(cls, context):
        return UserError("No job is running") if jobs.running() is None else None

    def invoke(self, context, event):
        job = jobs.running()
        if job.elapsed < ASKS_AFTER or not has_window():
            return self.execute(context)
        title = translated("Stop {job} at {done}?", job=translated(job.title), done=f"{job.fraction:.0%}")
        text = translated("Nothing of it would be kept")
        return context.window_manager.invoke_confirm(
            self,
            event,
            title=title,
            message=text,
            confirm_text=translated("Stop {job}", job=translated(job.title)),
        )

    def execute(self, context):
        if jobs.running() is not None:  # it may have ended while it was asked
            jobs.running().cancel()
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_cancel]
