# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands in Blender's own menus and headers, where F3 finds it too."""

import bpy

from .blender.object_references import source_of
from .jobs import display
from .live import sessions
from .names import Op


class ARAPFIELDS_MT_object(bpy.types.Menu):
    """Deform and stylize as rigidly as possible"""

    bl_label = "ARAP Fields"

    def draw(self, context):
        layout, source = self.layout, source_of(context)
        layout.operator(Op.PIN_TOOL, icon="PINNED")
        layout.operator(Op.PIN_ADD, icon="ADD")
        layout.operator(Op.ADD_HANDLE, icon="EMPTY_DATA")
        layout.operator(Op.ADD_BONES, text="Handles from Armature", icon="ARMATURE_DATA")
        layout.operator(Op.CARRY, icon="LINKED")
        layout.operator(Op.SET_REST, icon="PINNED")
        layout.operator(Op.RESET_HANDLE, icon="LOOP_BACK")
        layout.operator(Op.KEY_HANDLE, icon="KEY_HLT")
        layout.separator()
        layout.operator(Op.DEFORM, icon="MOD_SIMPLEDEFORM")
        icon = "PAUSE" if sessions.is_live(source, "DEFORM") else "PLAY"
        layout.operator(Op.LIVE, text="Pose", icon=icon).kind = "DEFORM"
        layout.operator(Op.STYLIZE, icon="MOD_EDGESPLIT")
        icon = "PAUSE" if sessions.is_live(source, "STYLIZE") else "PLAY"
        layout.operator(Op.LIVE, text="Live Stylize", icon=icon).kind = "STYLIZE"
        layout.operator(Op.WRAP, icon="MOD_SHRINKWRAP")
        layout.operator(Op.WRAP_SEQUENCE, icon="REC")
        layout.operator(Op.CLICK_LANDMARKS, icon="PINNED")
        layout.operator(Op.SKIN, icon="MOD_ARMATURE")
        layout.operator(Op.LIVE_KEEP, icon="CHECKMARK")
        layout.operator(Op.BAKE, icon="REC")
        layout.menu("ARAPFIELDS_MT_export", icon="EXPORT")
        layout.operator(Op.EXPORT_SPLATS, icon="EXPORT")
        layout.operator(Op.FIELD_NODES, icon="GEOMETRY_NODES")
        layout.separator()
        layout.operator(Op.FIT, icon="MOD_REMESH")
        layout.operator(Op.EXTRACT, icon="OUTLINER_OB_SURFACE")
        layout.operator(Op.SAVE_POSE, icon="FILE_TICK")
        layout.operator(Op.APPLY_POSE, icon="CHECKMARK")
        layout.operator(Op.APPLY_KEY, icon="SHAPEKEY_DATA")
        layout.operator_menu_enum(Op.REMOVE_RESULT, "kind", icon="X")
        layout.operator(Op.REMOVE_FIELD, text="Remove ARAP Fields Modifier", icon="X")


def draw_in_object_menu(menu, context):
    menu.layout.separator()
    menu.layout.menu("ARAPFIELDS_MT_object", icon="MOD_SIMPLEDEFORM")


def draw_in_empties(menu, context):
    """In Add › Empty: a handle of the active mesh object."""
    menu.layout.separator()
    operator = menu.layout.operator(Op.ADD_HANDLE, text="ARAP Fields Handle", icon="CUBE")
    operator.kind, operator.place = "CUBE", "CURSOR"


# Blender 4.2 has no menu of its own for Empties.
EMPTIES = "VIEW3D_MT_empty_add" if hasattr(bpy.types, "VIEW3D_MT_empty_add") else "VIEW3D_MT_add"
PLACES = {  # of bpy.types: what is drawn at the end
    "STATUSBAR_HT_header": display.draw,
    "VIEW3D_MT_object": draw_in_object_menu,
    EMPTIES: draw_in_empties,
}
CLASSES = [ARAPFIELDS_MT_object]


def begin():
    for name, draw in PLACES.items():
        getattr(bpy.types, name).append(draw)


def end():
    for name, draw in PLACES.items():
        getattr(bpy.types, name).remove(draw)
