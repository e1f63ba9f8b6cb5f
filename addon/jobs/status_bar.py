# SPDX-License-Identifier: GPL-3.0-or-later
"""The running job's progress, in the window's status bar, which is visible without the sidebar."""

from ..blender.language import translated
from ..core.runtime import jobs
from ..names import Op


def draw(header, context):
    """Draws what the job is at, its progress with the time left, and a button that cancels it."""
    job = jobs.running()
    if job is None:
        return
    row, left = header.layout.row(align=True), job.remaining
    text = f"{translated(job.title)}: {job.message}"
    if left is not None:
        text += translated(", about {seconds} s left", seconds=f"{left:.0f}")
    row.label(text=text, translate=False)
    row.progress(factor=job.fraction, text=f"{job.fraction:.0%}")  # too narrow for words
    row.operator(Op.CANCEL, icon="X")
