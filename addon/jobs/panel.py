# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender.language import translated
from ..blender.section import Section, wrapped
from ..core.runtime import jobs
from ..names import Op

ICONS = {"INFO": "CHECKMARK", "WARNING": "ERROR", "ERROR": "CANCEL"}


def draw_progress(layout, job):
    """The running job, at the top of the panel where it is seen: how far, what, how long, and the way out."""
    box = layout.box()
    box.progress(factor=job.fraction, text=f"{translated(job.title)} {job.fraction:.0%}")
    wrapped(box, job.message)
    left = job.remaining
    text = f"{job.elapsed:.0f} s"
    if left is not None:
        text += translated(", about {seconds} s left", seconds=f"{left:.0f}")
    box.label(text=text, translate=False)
    box.operator(Op.CANCEL, icon="X")


class ARAPFIELDS_PT_status(Section, bpy.types.Panel):
    bl_label = "Status"
    bl_order = 4
    needs_source = False

    @classmethod
    def poll(cls, context):
        return super().poll(context) and (jobs.running() is not None or bool(jobs.messages()))

    def fill(self, context, source, settings):
        layout = self.layout
        job = jobs.running()
        if job is not None:
            layout.label(
                text=translated("{job} is running (see the top)", job=translated(job.title)), icon="TIME"
            )
        for level, text in jobs.messages():
            wrapped(layout, text, icon=ICONS[level])


CLASSES = [ARAPFIELDS_PT_status]
