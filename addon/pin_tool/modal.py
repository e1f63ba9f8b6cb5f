# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixins of the pin tool's operators: their poll, and the modal drag from press to settled shape."""

import numpy as np

from ..blender import host
from ..blender.host import redraw
from ..blender.source_operator import ReportingOperator
from ..core.errors import UserError
from ..core.runtime import native
from ..live import sessions
from . import hints, screen
from .hover import View, hover

TICK = 0.05  # seconds between timer events while the shape settles
NAVIGATION = ("MIDDLEMOUSE", "WHEEL", "TRACKPAD", "NDOF", "NUMPAD")  # event types of view navigation


def reach_steps(event):
    """Steps by which an event increases a handle's reach; the keys are those of proportional editing."""
    if event.value != "PRESS":
        return 0
    if event.type in ("PAGE_UP", "PAGE_DOWN"):
        return 1 if event.type == "PAGE_UP" else -1
    if event.ctrl and event.type in ("WHEELUPMOUSE", "WHEELDOWNMOUSE"):
        return 1 if event.type == "WHEELDOWNMOUSE" else -1
    return 0


class PinOperator(ReportingOperator):
    """Mixin: works in a 3D view in Object Mode."""

    guide = "pins"

    @classmethod
    def obstacle(cls, context):
        wrong_mode = None if context.mode == "OBJECT" else UserError("Leave this mode first")
        return native.problem() or wrong_mode

    def change(self, context, source):
        raise UserError("A 3D view is needed")


class Dragging(PinOperator):
    """Mixin of modal operators that drag a handle until the button is released."""

    bl_options = {"UNDO"}

    def start(self, context, view, dragged, kind):
        self.drag, self.kind, self.timer = dragged, kind, None
        hover.drag = dragged
        self.grab(view, view.pixel)
        context.window_manager.modal_handler_add(self)
        hints.refresh()
        redraw(context, "WINDOW", "UI")
        return {"RUNNING_MODAL"}

    def grab(self, view, pixel):
        """Starts or restarts the drag from the handle's present location, the pixel and the present view."""
        matrix = self.drag.empty.get().matrix_world
        spot = view.pixel_of(matrix.translation)
        self.grab_offset, self.grab_point = np.subtract(spot, pixel), matrix.translation.copy()
        self.drag.start, self.pressed, self.center = matrix.copy(), pixel, spot
        self.last = pixel

    def modal(self, context, event):
        if hover.drag is not self.drag:  # cleared by loading a file or by undo
            return self.leave(context, {"CANCELLED"})
        try:
            return self.settle(context, event) if self.timer else self.follow(context, event)
        except (UserError, ReferenceError) as error:
            self.leave(context, None)
            return self.refuse(error)
        except Exception:
            self.leave(context, None)
            raise

    def follow(self, context, event):
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            self.drag.cancel(context)
            return self.leave(context, {"CANCELLED"})
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            if not self.drag.has_moved:
                return self.end(context, {"FINISHED"})
            self.timer = host.start_events(context, TICK)
            sessions.update(context)
            return {"RUNNING_MODAL"}
        steps = reach_steps(event)
        if steps:
            self.drag.change_reach(context, steps)
            redraw(context, "WINDOW", "UI")
            return {"RUNNING_MODAL"}
        if event.type.startswith(NAVIGATION):
            self.turned = True
            return {"PASS_THROUGH"}
        if event.type == "MOUSEMOVE":
            self.moved(context, View(context, event))
        return {"RUNNING_MODAL"}

    turned = False  # whether the view has changed since the last mouse move

    def moved(self, context, view):
        if self.turned:
            self.grab(view, self.last)
            self.turned = False
        if view.pixel == self.last:
            return
        self.last = view.pixel
        if self.kind == "TURN":
            angle = screen.turn_between(self.center, self.pressed, view.pixel)
            self.drag.turn(context, view.towards, angle)
        else:
            self.drag.move(context, view.beside(self.grab_point, self.grab_offset))

    def settle(self, context, event):
        """After the release: runs until the shape has settled, or until the next user event."""
        if event.type == "TIMER":
            sessions.update(context)
            return self.end(context, {"FINISHED"}) if self.drag.is_settled() else {"RUNNING_MODAL"}
        if event.type in ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE") or event.value == "RELEASE":
            return {"PASS_THROUGH"}
        return self.end(context, {"FINISHED", "PASS_THROUGH"})

    def end(self, context, result):
        self.drag.end(context)
        return self.leave(context, result)

    def leave(self, context, result):
        if self.timer is not None:
            host.stop_events(self.timer)
            self.timer = None
        if hover.drag is self.drag:
            hover.clear()
        hints.refresh()
        redraw(context, "WINDOW", "UI")
        return result

    def cancel(self, context):
        self.leave(context, None)
