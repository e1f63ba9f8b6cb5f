# SPDX-License-Identifier: GPL-3.0-or-later
"""Resizes a handle's box by its faces: changes the region that it holds, not its motion."""

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..blender.object_references import owner_of, refusal, settings_of
from ..blender.property_definitions import integer, number
from ..blender.source_operator import Guided
from ..core.errors import UserError
from ..names import Op
from . import empties, held_counts, movers

LEAST = 0.05  # least share of a box's size after one drag
FACES = [(axis, side) for axis in range(3) for side in (-1, 1)]


def boxed(context):
    """(source, entry) of the box whose Empty is active; UserError without one."""
    empty = context.view_layer.objects.active if context.view_layer else None
    source = owner_of(empty) if empty is not None and empty.type == "EMPTY" else None
    index = empties.find(source, empty) if source is not None else -1
    if index < 0 or settings_of(source).handles[index].kind != "CUBE":
        raise UserError("Select the Empty of a box")
    return source, settings_of(source).handles[index]


def stretch(axis, side, share):
    """(4, 4) map of the cube [-1, 1]³ that moves one face outwards by that share of the box's size."""
    share = max(share, LEAST - 1.0)
    moved = np.eye(4)
    moved[axis, axis], moved[axis, 3] = 1.0 + share, side * share
    return moved


def resize(source, entry, box, rest, change):
    """Applies `change` to a handle's box, (4, 4) cube → world, and to its rest box."""
    size = entry.empty.empty_display_size
    entry.empty.matrix_world = Matrix((box @ change @ np.diag([1 / size, 1 / size, 1 / size, 1])).tolist())
    entry.rest = (rest @ change).ravel()


class ARAPFIELDS_OT_resize_handle(Guided, bpy.types.Operator):
    """Move a face of the handle's box: what it holds at rest changes, where it has been moved stays"""

    bl_label = "Resize Box"
    guide = "handles"
    bl_options = {"REGISTER", "UNDO"}

    axis: integer("Axis", "0, 1 or 2: X, Y or Z of the Empty", min=0, max=2)
    side: integer("Side", "-1 or 1: which of the two faces", min=-1, max=1, default=1)
    share: number("Share", "How far the face moves outwards, of the box's size", options={"SKIP_SAVE"})

    @classmethod
    def obstacle(cls, context):
        try:
            return refusal(boxed(context)[0])
        except UserError as error:
            return error

    def begin(self, context):
        _, entry = boxed(context)
        rest = movers.rest_of(entry)
        self._before = empties.current_box(entry.empty), rest, entry.empty.matrix_world.copy()

    def change(self, context):
        source, entry = boxed(context)
        resize(source, entry, *self._before[:2], stretch(self.axis, self.side or 1, self.share))

    def execute(self, context):
        self.begin(context)
        self.change(context)
        return self.finish(context)

    def finish(self, context):
        context.view_layer.update()
        held_counts.count_for(self, context, boxed(context)[0])
        return {"FINISHED"}

    def invoke(self, context, event):
        self.begin(context)
        self._pixels = self.pixels_of_the_box(context)
        if self._pixels is None:
            return {"CANCELLED"}
        self._mouse = Vector((event.mouse_x, event.mouse_y))
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def pixels_of_the_box(self, context):
        """(2,) pixels on the screen from the opposite face to the dragged one; None if they coincide."""
        from bpy_extras.view3d_utils import location_3d_to_region_2d

        box = self._before[0]
        ends = [box[:3, 3] + box[:3, self.axis] * way * self.side for way in (-1, 1)]
        seen = [location_3d_to_region_2d(context.region, context.region_data, Vector(end)) for end in ends]
        if None in seen or (seen[1] - seen[0]).length < 2.0:
            return None
        return seen[1] - seen[0]

    def modal(self, context, event):
        if event.type == "MOUSEMOVE":
            moved = Vector((event.mouse_x, event.mouse_y)) - self._mouse
            self.share = moved.dot(self._pixels) / self._pixels.length_squared
            self.change(context)
        elif event.type in ("ESC", "RIGHTMOUSE"):
            _, entry = boxed(context)
            entry.empty.matrix_world, entry.rest = self._before[2], self._before[1].ravel()
            return {"CANCELLED"}
        elif event.type in ("LEFTMOUSE", "RET", "NUMPAD_ENTER") and event.value in ("RELEASE", "PRESS"):
            return self.finish(context)
        return {"RUNNING_MODAL"}


class ARAPFIELDS_GGT_box(bpy.types.GizmoGroup):
    """An arrow at each face of the active handle's box"""

    bl_label = "Box of a Handle"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT"}

    @classmethod
    def poll(cls, context):
        return ARAPFIELDS_OT_resize_handle.poll(context) and context.mode == "OBJECT"

    def setup(self, context):
        self.arrows = []
        for axis, side in FACES:
            arrow = self.gizmos.new("GIZMO_GT_arrow_3d")
            operator = arrow.target_set_operator(Op.RESIZE_HANDLE)
            operator.axis, operator.side = axis, side
            arrow.draw_style, arrow.length, arrow.use_draw_modal = "BOX", 0.0, True
            arrow.scale_basis, arrow.alpha, arrow.alpha_highlight = 0.8, 0.7, 1.0
            arrow.color_highlight = 1.0, 1.0, 1.0
            self.arrows.append(arrow)
        self.refresh(context)

    def refresh(self, context):
        try:
            _, entry = boxed(context)
        except UserError:
            return
        box = empties.current_box(entry.empty)
        for arrow, (axis, side) in zip(self.arrows, FACES, strict=True):
            arrow.color = entry.colour
            out = Vector(side * box[:3, axis])
            turn = out.to_track_quat("Z", "Y").to_matrix().to_4x4()
            arrow.matrix_basis = Matrix.Translation(Vector(box[:3, 3]) + out) @ turn

    def draw_prepare(self, context):
        self.refresh(context)


CLASSES = [ARAPFIELDS_OT_resize_handle, ARAPFIELDS_GGT_box]
