# SPDX-License-Identifier: GPL-3.0-or-later
import contextlib

import bpy

from ..blender.language import translated
from ..blender.object_references import ObjectReference, source_of
from ..core.errors import UserError
from ..core.runtime.coroutines import Pause
from ..core.runtime.jobs import Item
from ..core.runtime.progress import JobCancelled
from ..handles.empties import require_handles
from ..jobs.job_operator import JobOperator, with_progress
from ..live.session import Session
from ..names import Op
from ..results import result_objects


class ARAPFIELDS_OT_bake(JobOperator, bpy.types.Operator):
    """Make an object with one shape key a frame that plays what the animated handles do"""

    bl_idname = Op.BAKE
    bl_label = "Bake Animation"
    bl_options = {"UNDO"}
    title = "Bake"
    guide = "deform"
    refuses = staticmethod(require_handles)

    start: bpy.props.IntProperty(
        name="Start", description="First frame; 0 for the scene's", default=0, min=0, options={"SKIP_SAVE"}
    )
    end: bpy.props.IntProperty(
        name="End", description="Last frame; 0 for the scene's", default=0, min=0, options={"SKIP_SAVE"}
    )
    step: bpy.props.IntProperty(
        name="Step", description="Frames from one key to the next", default=1, min=1, options={"SKIP_SAVE"}
    )

    def prepare(self, context, job):
        try:
            return [(yield from self.read(context, job))]
        except (UserError, ValueError) as error:
            self.failures.append(translated(error))
            return []

    def read(self, context, job):
        """Plays the frames once and notes where the handles are; the scene ends where it was."""
        source, scene, present = source_of(context), context.scene, context.scene.frame_current
        frames = list(range(self.start or scene.frame_start, (self.end or scene.frame_end) + 1, self.step))
        if not frames:
            raise UserError("the last frame comes before the first")
        requests = []
        try:
            scene.frame_set(frames[0])
            session = Session(context, source, shown=False, follow=False)
            yield from with_progress(job, session.reading, source.name)
            for number, frame in enumerate(frames):
                job.report_main_thread(
                    0.1 * number / len(frames), translated("Reading frame {frame}", frame=frame)
                )
                scene.frame_set(frame)
                requests.append(session.current_request(context, source))
                yield Pause.REDRAW
        finally:
            with contextlib.suppress(ReferenceError):
                scene.frame_set(present)
        reference = ObjectReference(source)

        def work(tracker):
            task = tracker.start("Solving", 1.0)
            session.prepare()
            shapes = []
            for number, request in enumerate(requests):
                if task.cancelled:
                    raise JobCancelled
                task.report(number / len(requests), translated("frame {frame}", frame=frames[number]))
                session.solve(request, iterations=30)
                shapes.append(session.local(session.solver.field(session.rest)))
            return shapes

        def apply(shapes):
            return (yield from add_keys(context, reference.get(), session, frames, shapes, job))

        return Item(source.name, work, apply)


def add_keys(context, source, session, frames, shapes, job):
    """The baked object, key by key; taken away again where the user cancels."""
    if session.topology is not None:
        mesh = result_objects.surface_mesh(source, shapes[0], session.topology)
    else:
        mesh = result_objects.shown_mesh(context, source, len(session.rest))
    item = result_objects.show(context, source, "BAKE", "BAKE", mesh, {"frames": len(frames)})
    kept = False
    try:
        for number in range(len(frames)):
            job.report_main_thread(
                number / len(frames), translated("Storing frame {frame}", frame=frames[number])
            )
            result_objects.add_frame(item, frames, number, shapes[number])
            yield Pause.REDRAW
        context.scene.frame_set(context.scene.frame_current)  # else the key stored last stays on
        result_objects.hide(source)
        kept = True
    finally:
        if not kept:
            with contextlib.suppress(ReferenceError):
                result_objects.discard(item)
    return translated("{count} frames baked", count=len(frames))


CLASSES = [ARAPFIELDS_OT_bake]
