# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool in the toolbar of Object Mode, and its key map, which the user can change."""

from pathlib import Path

import bpy

from ..blender.host import has_window
from ..blender.object_references import settings_of, source_of
from ..names import TOOL, Op

ICON = str(Path(__file__).resolve().parents[1] / "icons" / "pin")  # Blender adds .dat
RADIUS = "scene.arapfields.pin_radius"


class ARAPFIELDS_TOOL_pin(bpy.types.WorkSpaceTool):
    bl_space_type = "VIEW_3D"
    bl_context_mode = "OBJECT"
    bl_idname = TOOL
    bl_label = "ARAP Pin"
    bl_description = (
        "Pin the active object and drag it: the shape follows, as rigid as it can be. "
        "Shift-click: anchor. Ctrl-click or X: delete. R or the ring: turn. I: keyframe. F: radius. "
        "Ctrl-wheel in a drag: reach. Alt-click: pin another object"
    )
    bl_icon = ICON
    bl_cursor = "CROSSHAIR"
    bl_keymap = (
        (Op.PIN_HOVER, {"type": "MOUSEMOVE", "value": "ANY", "any": True}, None),
        (Op.PIN_DRAG, {"type": "LEFTMOUSE", "value": "PRESS"}, None),
        (
            Op.PIN_DRAG,
            {"type": "LEFTMOUSE", "value": "PRESS", "alt": True},
            {"properties": [("other", True)]},
        ),
        # Beside the mesh, where Blender's own drag would move what is selected.
        ("view3d.select_box", {"type": "LEFTMOUSE", "value": "CLICK_DRAG"}, None),
        (Op.PIN_ANCHOR, {"type": "LEFTMOUSE", "value": "PRESS", "shift": True}, None),
        (
            Op.PIN_DELETE,
            {"type": "LEFTMOUSE", "value": "PRESS", "ctrl": True},
            {"properties": [("under", True)]},
        ),
        (Op.PIN_DELETE, {"type": "X", "value": "PRESS"}, None),
        (Op.PIN_DELETE, {"type": "DEL", "value": "PRESS"}, None),
        (Op.PIN_TURN, {"type": "R", "value": "PRESS"}, None),
        (Op.KEY_HANDLE, {"type": "I", "value": "PRESS"}, None),  # Blender's I would key the mesh
        (
            "wm.radial_control",
            {"type": "F", "value": "PRESS"},
            {"properties": [("data_path_primary", RADIUS)]},
        ),
    )

    def draw_settings(context, layout, tool):
        source = source_of(context)
        layout.prop(context.scene.arapfields, "pin_radius")
        layout.prop(context.scene.arapfields, "pin_holds_turn")
        if source is not None:
            settings = settings_of(source)
            layout.prop(settings.deform, "symmetry")
            if settings.handles:
                layout.prop(settings.deform, "locality")
                layout.prop(settings.contact, "use")


def register():
    if has_window():
        bpy.utils.register_tool(ARAPFIELDS_TOOL_pin, after={"builtin.measure"}, separator=True)


def unregister():
    if hasattr(ARAPFIELDS_TOOL_pin, "_bl_tool"):
        bpy.utils.unregister_tool(ARAPFIELDS_TOOL_pin)
