# SPDX-License-Identifier: GPL-3.0-or-later
"""The running job in the window's status bar, which is visible without the sidebar."""

from ..blender.language import translated
from ..core.runtime import jobs
from ..names import Op


def draw(header, context):
    """Draws the job's progress and a button that cancels it."""
    job = jobs.running()
    if job is None:
        return
    row = header.layout.row(align=True)
    row.progress(factor=job.fraction, text=f"{translated(job.title)} {job.fraction:.0%}")
    row.operator(Op.CANCEL, icon="X")
