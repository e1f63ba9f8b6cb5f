# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators of the pin tool, and their drag from press to settled shape."""

import bpy
import numpy as np

from ..blender import host, references
from ..blender.host import redraw
from ..blender.object_references import owner_of, select_alone
from ..blender.property_definitions import flag, number
from ..blender.source_operator import ReportingOperator
from ..carried import carrying
from ..core.errors import UserError
from ..core.runtime import native
from ..live import sessions
from ..live.live_solver import prefetch
from ..names import TOOL
from . import drag, drawing, pins, screen
from .hover import View, hover, under

# Mixins of the pin tool's operators: their poll, and the modal drag from press to settled shape.

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


def look(context, view, other=False):
    """Finds what lies under the cursor and what a press would do there."""
    hover.target, hover.missed = under(context, view, lights=True, other=other), None
    hover.pixel, hover.region = view.pixel, context.region.as_pointer()
    hover.label = "" if hover.target is None else drawing.label(hover.target)


class PinOperator(ReportingOperator):
    """Mixin: works in a 3D view in Object Mode."""

    guide = "pins"

    @classmethod
    def obstacle(cls, context):
        wrong_mode = None if context.mode == "OBJECT" else UserError("Leave this mode first")
        return native.problem() or wrong_mode

    def change(self, context, source):
        raise UserError("A 3D view is needed")

    def show(self, context, event):
        """Shows what lies under the cursor, if the event is one over the view."""
        view = None if event is None or context.region_data is None else View(context, event)
        if view is not None and view.is_inside:
            look(context, view, other=event.alt)
        drawing.refresh()
        redraw(context, "WINDOW", "UI")


class Dragging(PinOperator):
    """Mixin of modal operators that drag a handle until the button is released."""

    bl_options = {"UNDO"}

    def start(self, context, view, dragged, kind):
        self.drag, self.kind, self.timer = dragged, kind, None
        hover.drag = dragged
        self.grab(view, view.pixel)
        context.window_manager.modal_handler_add(self)
        drawing.refresh()
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
            return self.leave(context, {"CANCELLED"}, event)
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            if not self.drag.has_moved:
                return self.end(context, {"FINISHED"}, event)
            self.timer, self.drag.is_released = host.start_events(context, TICK), True
            sessions.update(context)
            self.show(context, event)
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
            return self.end(context, {"FINISHED"}, event) if self.drag.is_settled() else {"RUNNING_MODAL"}
        if event.type in ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE") or event.value == "RELEASE":
            return {"PASS_THROUGH"}
        return self.end(context, {"FINISHED", "PASS_THROUGH"}, event)

    def end(self, context, result, event):
        self.drag.end(context)
        return self.leave(context, result, event)

    def leave(self, context, result, event=None):
        """Ends the drag; by an `event`, what lies under the cursor then is shown at once."""
        if self.timer is not None:
            host.stop_events(self.timer)
            self.timer = None
        if hover.drag is self.drag:
            hover.clear()
        self.show(context, event)
        return result

    def cancel(self, context):
        self.leave(context, None)


def source_of_target(target):
    """The object under the cursor; UserError if it cannot be pinned."""
    source = target.source.get()
    if target.kind == "REFUSED":
        raise pins.refusal(source)
    return source


def drag_of_new_pin(context, source, target, **further):
    """Places a pin on the surface under the cursor and starts its Drag."""
    where = {"face": target.face, "face_count": target.face_count}
    return drag.of_new_pin(context, source, target.location, target.radius, **where, **further)


def view_at_press(context, event):
    """The View of a press, with the pixel where the button went down.

    Where Blender is late, as after a long update, the event has the cursor's later place.
    """
    view = View(context, event)
    last = event.mouse_prev_x - context.region.x, event.mouse_prev_y - context.region.y
    if hover.region == context.region.as_pointer() and hover.pixel == last:
        view.pixel = last
    return view


class ARAPFIELDS_OT_pin_tool(PinOperator, bpy.types.Operator):
    """Take the tool that pins the surface and drags it, in the toolbar"""

    bl_label = "ARAP Pin Tool"

    def change(self, context, source):
        if bpy.app.background:
            raise UserError("A window is needed")
        bpy.ops.wm.tool_set_by_id(name=TOOL, space_type="VIEW_3D")


class ARAPFIELDS_OT_pin_hover(PinOperator, bpy.types.Operator):
    """Light up what lies under the cursor"""

    bl_label = "ARAP Pin: Light Up"
    bl_options = {"INTERNAL"}

    def invoke(self, context, event):
        if context.region_data is not None and hover.held is None:
            view = View(context, event)
            before = hover.target or hover.missed
            look(context, view, other=event.alt)
            drawing.refresh()
            if before is not None or hover.target is not None:
                context.region.tag_redraw()
            source = hover.target.source.find() if hover.target is not None else None
            if source is not None and hover.target.kind == "SURFACE" and not sessions.is_live(source):
                prefetch.prepare(context, source)
        return {"PASS_THROUGH"}


class ARAPFIELDS_OT_pin_drag(Dragging, bpy.types.Operator):
    """Place a pin on the surface under the cursor, or take the one that is there, and drag it"""

    bl_label = "ARAP Pin: Drag"

    other: flag("Any Object", "Pin the object under the cursor, active or not", options={"SKIP_SAVE"})

    def invoke(self, context, event):
        view = view_at_press(context, event)
        target = under(context, view, other=self.other)
        if target is None:
            return self.miss(context, view)
        if target.kind == "OTHER":
            self.report({"INFO"}, drawing.label(target))
            return {"CANCELLED"}
        try:
            source = source_of_target(target)
            if target.kind == "SURFACE":
                kind = "PIN" if context.scene.arapfields.pin_holds_turn else "POINT"
                return self.start(context, view, drag_of_new_pin(context, source, target, kind=kind), "MOVE")
            entry = pins.entry_of(target.empty.get())
            if entry.anchor:
                return {"FINISHED"} if pins.choose(context, entry.empty) else {"CANCELLED"}
            dragged = drag.of_entry(context, source, entry)
            return self.start(context, view, dragged, "TURN" if target.kind == "RING" else "MOVE")
        except (UserError, ValueError) as error:
            return self.refuse(error)

    def miss(self, context, view):
        """Shows that a press has met nothing."""
        hover.missed, hover.pixel, hover.region = view.pixel, view.pixel, context.region.as_pointer()
        context.region.tag_redraw()
        return {"PASS_THROUGH"}


class ARAPFIELDS_OT_pin_anchor(PinOperator, bpy.types.Operator):
    """Place an anchor on the surface under the cursor, or make the pin there an anchor or a pin again"""

    bl_label = "ARAP Pin: Anchor"
    bl_options = {"UNDO"}

    def invoke(self, context, event):
        target = under(context, view_at_press(context, event))
        if target is None:
            return {"PASS_THROUGH"}
        if target.kind == "OTHER":
            self.report({"INFO"}, drawing.label(target))
            return {"CANCELLED"}
        try:
            source = source_of_target(target)
            if target.kind == "SURFACE":
                drag_of_new_pin(context, source, target, anchor=True).end(context)
            else:
                entry = pins.entry_of(target.empty.get())
                pins.choose(context, entry.empty)
                entry.anchor = not entry.anchor
                drag.of_entry(context, source, entry).end(context)
        except (UserError, ValueError) as error:
            return self.refuse(error)
        self.show(context, event)
        return {"FINISHED"}


class ARAPFIELDS_OT_pin_add(PinOperator, bpy.types.Operator):
    """Place a pin on the object, at the place of its shown surface that is nearest to a location"""

    bl_label = "ARAP Pin: Add"
    bl_options = {"REGISTER", "UNDO"}

    location: bpy.props.FloatVectorProperty(
        name="Location", description="Where the pin is placed, in the world", subtype="TRANSLATION"
    )
    radius: number(
        "Radius", "Of the region that the pin holds, in the world", subtype="DISTANCE", default=0.1, min=1e-6
    )
    anchor: flag("Anchor", "Place an anchor")
    hold_turn: flag("Hold Turn", "Hold how the surface is turned, too", default=True)

    def invoke(self, context, event):
        self.location = context.scene.cursor.location
        return self.execute(context)

    def change(self, context, source):
        if source is None:
            raise UserError("Select a mesh object")
        kind = "PIN" if self.hold_turn else "POINT"
        pins.place(context, source, np.array(self.location), self.radius, anchor=self.anchor, kind=kind)


class ARAPFIELDS_OT_pin_delete(PinOperator, bpy.types.Operator):
    """Delete the chosen pin or handle with its Empty, or the one under the cursor"""

    bl_label = "ARAP Pin: Delete"
    bl_options = {"UNDO"}

    under: flag("Under the Cursor", "The one under the cursor", options={"SKIP_SAVE"})

    def invoke(self, context, event):
        if not self.under:
            return self.delete(context, pins.chosen(context), event)
        target = under(context, view_at_press(context, event))
        empty = target.empty.find() if target is not None and target.kind == "HANDLE" else None
        return self.delete(context, empty, event)

    def execute(self, context):
        return self.delete(context, pins.chosen(context))

    def delete(self, context, empty, event=None):
        if empty is None:
            return {"PASS_THROUGH"}
        pins.remove(context, owner_of(empty), empty)
        hover.clear()
        self.show(context, event)
        return {"FINISHED"}


class ARAPFIELDS_OT_pin_turn(PinOperator, bpy.types.Operator):
    """Turn the chosen pin, by the mouse or about an axis as Blender's R does; the shape follows"""

    bl_label = "ARAP Pin: Turn"

    def invoke(self, context, event):
        empty = pins.chosen(context)
        if empty is None:
            return {"PASS_THROUGH"}
        source = owner_of(empty)
        moved = carrying.with_carried(source)
        before = references.referred(moved)
        try:
            drag.begin_live(context, source)
        except (UserError, ValueError) as error:
            references.push_new("Live", moved, before)
            return self.refuse(error)
        sessions.live[source.session_uid].keeps_shape = True
        pins.entry_of(empty).hold_turn = True
        select_alone(context, empty)
        references.push_new("Live", moved, before)  # the turn may be cancelled, and live mode goes on
        return bpy.ops.transform.rotate("INVOKE_DEFAULT") and {"FINISHED"}


CLASSES = [
    ARAPFIELDS_OT_pin_tool,
    ARAPFIELDS_OT_pin_hover,
    ARAPFIELDS_OT_pin_drag,
    ARAPFIELDS_OT_pin_anchor,
    ARAPFIELDS_OT_pin_add,
    ARAPFIELDS_OT_pin_delete,
    ARAPFIELDS_OT_pin_turn,
]
