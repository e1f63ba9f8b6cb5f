# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
import numpy as np

from ..blender.host import redraw
from ..blender.object_references import owner_of
from ..blender.property_definitions import flag, number
from ..blender.selection import select_alone
from ..core.errors import UserError
from ..live import sessions
from ..live.prefetch import prefetch
from ..names import TOOL
from . import drag, hints, pins
from .hover import View, hover, under
from .modal import Dragging, PinOperator


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
        if context.region_data is not None and hover.drag is None:
            view = View(context, event)
            before = hover.target or hover.missed
            hover.target, hover.missed = under(context, view, lights=True, other=event.alt), None
            hover.pixel, hover.region = view.pixel, context.region.as_pointer()
            hover.label = "" if hover.target is None else hints.label(hover.target)
            hints.refresh()
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
            self.report({"INFO"}, hints.label(target))
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
            self.report({"INFO"}, hints.label(target))
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
        redraw(context, "WINDOW", "UI")
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
            return self.execute(context)
        target = under(context, view_at_press(context, event))
        empty = target.empty.find() if target is not None and target.kind == "HANDLE" else None
        return self.delete(context, empty)

    def execute(self, context):
        return self.delete(context, pins.chosen(context))

    def delete(self, context, empty):
        if empty is None:
            return {"PASS_THROUGH"}
        pins.remove(context, owner_of(empty), empty)
        hover.clear()
        redraw(context, "WINDOW", "UI")
        return {"FINISHED"}


class ARAPFIELDS_OT_pin_turn(PinOperator, bpy.types.Operator):
    """Turn the chosen pin, by the mouse or about an axis as Blender's R does; the shape follows"""

    bl_label = "ARAP Pin: Turn"

    def invoke(self, context, event):
        empty = pins.chosen(context)
        if empty is None:
            return {"PASS_THROUGH"}
        source = owner_of(empty)
        try:
            drag.begin_live(context, source)
        except (UserError, ValueError) as error:
            return self.refuse(error)
        sessions.live[source.session_uid].keeps_shape = True
        pins.entry_of(empty).hold_turn = True
        select_alone(context, empty)
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
