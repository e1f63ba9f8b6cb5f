# SPDX-License-Identifier: GPL-3.0-or-later
"""What the pin tool's operators share: where they work, and the modal drag from the press to the rest."""

import numpy as np

from ..blender import timers
from ..blender.redraw import redraw
from ..blender.source_operator import ReportingOperator
from ..core.errors import UserError
from ..core.runtime import native
from ..live import sessions
from . import screen
from .hover import View, hover

TICK = 0.05  # seconds between looks at a shape that comes to rest
NAVIGATION = ("MIDDLEMOUSE", "WHEEL", "TRACKPAD", "NDOF", "NUMPAD")  # types of events that turn the view


def reach_steps(event):
    """By how many steps an event has a handle reach farther; the keys are those of proportional editing."""
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
        redraw(context, "WINDOW", "UI")
        return {"RUNNING_MODAL"}

    def grab(self, view, pixel):
        """The handle is held where it is now, by that pixel, as the view is now."""
        matrix = self.drag.empty.get().matrix_world
        spot = view.pixel_of(matrix.translation)
        self.grab_offset, self.grab_point = np.subtract(spot, pixel), matrix.translation.copy()
        self.drag.start, self.pressed, self.center = matrix.copy(), pixel, spot
        self.last = pixel

    def modal(self, context, event):
        if hover.drag is not self.drag:  # taken away from outside: a file is loaded, a step undone
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
            self.timer = timers.start_events(context, TICK)
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

    turned = False  # whether the view was, since the mouse moved

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
        """The button is up: the shape comes to rest, or until the user goes on."""
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
            timers.stop_events(self.timer)
            self.timer = None
        if hover.drag is self.drag:
            hover.clear()
        redraw(context, "WINDOW", "UI")
        return result

    def cancel(self, context):
        self.leave(context, None)
