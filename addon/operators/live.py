# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..bridge import handles, live, results
from ..bridge.lookup import refusal, source_of
from ..core import native
from ..core.errors import UserError
from ..names import Op


class LiveOperator:
    """Mixin: needs a source with handles."""

    @classmethod
    def poll(cls, context):
        source = source_of(context)
        reason = native.problem() or refusal(source)
        if not reason and not handles.used(source):
            reason = "Add a handle first"
        if reason:
            cls.poll_message_set(reason)
        return not reason


class ARAPFIELDS_OT_live(LiveOperator, bpy.types.Operator):
    """Let a result follow the handles while they move; again to stop"""

    bl_idname = Op.LIVE
    bl_label = "Live"
    bl_options = {"UNDO"}

    def execute(self, context):
        source = source_of(context)
        if live.is_live(source):
            live.end(source)
            return {"FINISHED"}
        try:
            live.begin(context, source)
            live.update(context, wait=10.0)
        except (UserError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class ARAPFIELDS_OT_bake(LiveOperator, bpy.types.Operator):
    """Make an object with one shape key a frame that plays what the animated handles do"""

    bl_idname = Op.BAKE
    bl_label = "Bake Animation"
    bl_options = {"UNDO"}

    start: bpy.props.IntProperty(
        name="Start", description="First frame; 0 for the scene's", default=0, min=0, options={"SKIP_SAVE"}
    )
    end: bpy.props.IntProperty(
        name="End", description="Last frame; 0 for the scene's", default=0, min=0, options={"SKIP_SAVE"}
    )
    step: bpy.props.IntProperty(
        name="Step", description="Frames from one key to the next", default=1, min=1, options={"SKIP_SAVE"}
    )

    def execute(self, context):
        source, scene = source_of(context), context.scene
        frames = range(self.start or scene.frame_start, (self.end or scene.frame_end) + 1, self.step)
        present, manager = scene.frame_current, context.window_manager
        if not frames:
            self.report({"ERROR"}, "the last frame comes before the first")
            return {"CANCELLED"}
        manager.progress_begin(0, len(frames))
        shapes = []
        try:
            scene.frame_set(frames[0])
            session = live.Session(context, source, output="BAKE")
            try:
                for number, frame in enumerate(frames):
                    scene.frame_set(frame)
                    goal = live.targets_of(context, source)
                    shapes.append(session.moved(goal))
                    manager.progress_update(number)
            finally:
                session.follower.stop()
            results.add_frames(session.result.get(), list(frames), shapes)
        except (UserError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            manager.progress_end()
            scene.frame_set(present)
        self.report({"INFO"}, f"{source.name}: {len(frames)} frames baked")
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_live, ARAPFIELDS_OT_bake]
