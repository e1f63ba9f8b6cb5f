# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of landmarks by click: a place on the object, then the same place on the target."""

import bpy
import numpy as np
from bpy_extras import view3d_utils

from ..blender.language import translated
from ..blender.object_references import ObjectReference, settings_of, source_of
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError
from ..results import visibility
from . import landmarks

AROUND = np.arange(0, 2 * np.pi, np.pi / 4)
# Offsets in pixels around a click that are searched for a surface: scans have holes, and limbs are thin.
OFFSETS = [np.zeros(2), *(r * np.array([np.cos(a), np.sin(a)]) for r in (3, 6, 9, 12) for a in AROUND)]
NAVIGATION = (110, 320)  # size in pixels of the navigation gizmos in the view's upper right corner


def covers(region, spot):
    """Whether a region contains that pixel of the window."""
    return 0 <= spot[0] - region.x < region.width and 0 <= spot[1] - region.y < region.height


def is_navigation(context, region, spot):
    """Whether a pixel of the window is on the view's navigation gizmos."""
    space, scale = context.area.spaces.active, context.preferences.system.ui_scale
    if not (space.show_gizmo and space.show_gizmo_navigate):
        return False
    aside = [r.x for r in context.area.regions if r.type == "UI" and r.width > 1 and r.x > region.x]
    right, top = min([region.x + region.width, *aside]), region.y + region.height
    return spot[0] > right - scale * NAVIGATION[0] and spot[1] > top - scale * NAVIGATION[1]


class ARAPFIELDS_OT_click_landmarks(SourceOperator, bpy.types.Operator):
    """Click a place on the object, then where it belongs on the target, again and again"""

    bl_label = "Click Landmarks"
    bl_options = {"UNDO"}
    guide = "wrap"
    missed = False  # whether the last click met neither object

    @classmethod
    def refuses(cls, source):
        return landmarks.refusal(source)

    def change(self, context, source):
        raise UserError("A 3D view is needed")

    def invoke(self, context, event):
        if context.area is None or context.area.type != "VIEW_3D":
            return self.execute(context)
        source = source_of(context)
        self.ends = [ObjectReference(source), ObjectReference(landmarks.target_of(source))]
        self.clicked = {}
        visibility.show_landmarks(source, True)
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
        """Handles a click, also beside both objects; False if it belongs to another region or a gizmo."""
        spot = event.mouse_x, event.mouse_y
        whole = next(r for r in context.area.regions if r.type == "WINDOW")
        if not covers(whole, spot) or any(covers(r, spot) for r in context.area.regions if r != whole):
            return False
        which, place = self.struck(context, whole, np.subtract(spot, (whole.x, whole.y)))
        if which is None and is_navigation(context, whole, spot):
            return False
        self.missed = which is None
        if self.missed:
            self.report({"WARNING"}, self.miss())
            return True
        self.clicked[which] = np.array(place)
        if len(self.clicked) == 2:
            landmarks.place(context, *(end.get() for end in self.ends), self.clicked[0], self.clicked[1])
            self.clicked = {}
        return True

    def struck(self, context, region, pixel):
        """(index of the end, location) of the surface under a pixel or near it; else (None, None)."""
        view, graph = context.area.spaces.active.region_3d, context.evaluated_depsgraph_get()
        scale = context.preferences.system.ui_scale
        for offset in OFFSETS:
            at = pixel + scale * offset
            origin = view3d_utils.region_2d_to_origin_3d(region, view, at)
            direction = view3d_utils.region_2d_to_vector_3d(region, view, at)
            hit, place, _, _, item, _ = context.scene.ray_cast(graph, origin, direction)
            for which, end in enumerate(self.ends):
                if hit and end.find() == item.original:
                    return which, place
        return None, None

    def take_back(self):
        """Removes the clicked half of a pair, else the last pair."""
        source, self.missed = self.ends[0].get(), False
        count = len(settings_of(source).wrap.landmarks)
        if self.clicked:
            self.clicked = {}
        elif count:
            landmarks.remove(source, count - 1)

    def miss(self):
        names = [end.name for end in self.ends]
        return translated("Neither {source} nor {target} lies there", source=names[0], target=names[1])

    def tell(self, context):
        names = [end.name for end in self.ends]
        if not self.clicked:
            text = translated("Click a place on {source} or on {target}", source=names[0], target=names[1])
        else:
            missing = names[1] if 0 in self.clicked else names[0]
            text = translated("Click the same place on {name}", name=missing)
        keys = translated("Backspace takes back, Enter ends")
        if self.missed:
            text = f"{self.miss()}. {text}"
        context.area.header_text_set(f"{text}. {keys}")
        context.area.tag_redraw()

    def end(self, context):
        context.area.header_text_set(None)
        return {"FINISHED"}


CLASSES = [ARAPFIELDS_OT_click_landmarks]
