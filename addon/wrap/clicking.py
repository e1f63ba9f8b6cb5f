# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of landmarks by click: a place on the object, then the same place on the target."""

import bpy
import numpy as np
from bpy_extras import view3d_utils

from ..blender.language import translated
from ..blender.object_references import ObjectReference, settings_of, source_of
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError
from ..names import Op
from . import landmarks


class ARAPFIELDS_OT_click_landmarks(SourceOperator, bpy.types.Operator):
    """Click a place on the object, then where it belongs on the target, again and again"""

    bl_idname = Op.CLICK_LANDMARKS
    bl_label = "Click Landmarks"
    bl_options = {"UNDO"}
    guide = "wrap"

    @classmethod
    def refuses(cls, source):
        return landmarks.refusal(source)

    def invoke(self, context, event):
        if context.area is None or context.area.type != "VIEW_3D":
            self.report({"ERROR"}, translated(UserError("a 3D view is needed")))
            return {"CANCELLED"}
        source = source_of(context)
        self.ends = [ObjectReference(source), ObjectReference(landmarks.target_of(source))]
        self.clicked = {}
        self.tell(context)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in {"ESC", "RET", "NUMPAD_ENTER", "RIGHTMOUSE"} and event.value == "PRESS":
            return self.end(context)
        try:
            if event.type == "BACK_SPACE" and event.value == "PRESS":
                self.take_back()
            elif event.type == "LEFTMOUSE" and event.value == "PRESS":
                if not self.click(context, event):
                    return {"PASS_THROUGH"}
            else:
                return {"PASS_THROUGH"}
        except (UserError, ValueError) as error:
            self.report({"ERROR"}, translated(error))
            return self.end(context)
        self.tell(context)
        return {"RUNNING_MODAL"}

    def click(self, context, event):
        """Takes a click on one of the two objects; whether it was one."""
        region = next((r for r in context.area.regions if r.type == "WINDOW"), None)
        pixel = event.mouse_x - region.x, event.mouse_y - region.y
        if not (0 <= pixel[0] < region.width and 0 <= pixel[1] < region.height):
            return False
        view = context.area.spaces.active.region_3d
        origin = view3d_utils.region_2d_to_origin_3d(region, view, pixel)
        direction = view3d_utils.region_2d_to_vector_3d(region, view, pixel)
        hit, place, _, _, item, _ = context.scene.ray_cast(
            context.evaluated_depsgraph_get(), origin, direction
        )
        which = next((k for k, end in enumerate(self.ends) if hit and end.find() == item.original), None)
        if which is None:
            return False
        self.clicked[which] = np.array(place)
        if len(self.clicked) == 2:
            landmarks.place(context, *(end.get() for end in self.ends), self.clicked[0], self.clicked[1])
            self.clicked = {}
        return True

    def take_back(self):
        """The half of a pair that was clicked, else the last pair."""
        source = self.ends[0].get()
        count = len(settings_of(source).wrap.landmarks)
        if self.clicked:
            self.clicked = {}
        elif count:
            landmarks.remove(source, count - 1)

    def tell(self, context):
        names = [end.name for end in self.ends]
        if not self.clicked:
            text = translated("Click a place on {source} or on {target}", source=names[0], target=names[1])
        else:
            missing = names[1] if 0 in self.clicked else names[0]
            text = translated("Click the same place on {name}", name=missing)
        keys = translated("Backspace takes back, Enter ends")
        context.area.header_text_set(f"{text}. {keys}")
        context.area.tag_redraw()

    def end(self, context):
        context.area.header_text_set(None)
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_click_landmarks]
